//! Opening devices: one under validation at a time.
//!
//! The validation layer keeps its instances and devices in a table that every call reads without a lock and that making or
//! destroying one of them changes (its issue 4391; seen with helgrind in 1.3.239). Two validated devices in two threads
//! broke the heap in some runs of hundreds. So a process has one: whoever asks again gets the same.

use std::sync::{Arc, Condvar, Mutex, Weak};

use anyhow::{Result, bail};

use super::choice::DeviceChoice;
use super::device::{Device, Instance, RightToValidate, lock};
use super::error::NotOpened;

struct Slot {
    wish: Wish,
    /// Of nothing while the device is being made, and once its last owner is gone.
    device: Weak<Device>,
}

/// What was asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Wish {
    Plain(DeviceChoice),
    TakingTurns(DeviceChoice),
    /// It shows pictures in a window of its own.
    #[cfg(feature = "window")]
    Window(DeviceChoice),
}

impl Wish {
    fn is_shared(&self) -> bool {
        matches!(self, Self::Plain(_) | Self::TakingTurns(_))
    }
}

static SLOT: Mutex<Option<Slot>> = Mutex::new(None);
static FREED: Condvar = Condvar::new();

/// The right to have the validated device; whoever drops it gives it back.
struct Turn(());

impl Drop for Turn {
    fn drop(&mut self) {
        *lock(&SLOT) = None;
        FREED.notify_all();
    }
}

/// The device that there is, or the right to make it.
enum Validated {
    Shared(Arc<Device>),
    Mine(Turn),
}

/// Waits for a device that is being made or destroyed.
///
/// # Errors
/// Where there is one of another kind.
fn take(wish: Wish) -> Result<Validated> {
    let mut slot = lock(&SLOT);
    loop {
        match &*slot {
            None => break,
            Some(other) => match other.device.upgrade() {
                Some(device) if other.wish == wish && wish.is_shared() => return Ok(Validated::Shared(device)),
                Some(device) => bail!(NotOpened::Validated {
                    device: device.info().name.clone(),
                    has: format!("{:?}", other.wish),
                    wanted: format!("{wish:?}"),
                }),
                None => slot = FREED.wait(slot).unwrap_or_else(std::sync::PoisonError::into_inner),
            },
        }
    }
    *slot = Some(Slot { wish, device: Weak::new() });
    Ok(Validated::Mine(Turn(())))
}

/// Shares a device that was made by right of a [`Turn`].
pub(super) fn share(device: &Arc<Device>) {
    if let Some(slot) = &mut *lock(&SLOT) {
        slot.device = Arc::downgrade(device);
    }
    FREED.notify_all();
}

/// The right to make the device of a window, which is not shared.
///
/// # Errors
/// Where there is another one.
#[cfg(feature = "window")]
pub(super) fn for_a_window(choice: &DeviceChoice) -> Result<RightToValidate> {
    match take(Wish::Window(choice.clone()))? {
        Validated::Mine(turn) => Ok(Box::new(turn)),
        Validated::Shared(_) => unreachable!("a window's device is its own"),
    }
}

impl Device {
    /// Opens the chosen device; with `validate`, core and synchronization validation report into [`Device::messages`].
    ///
    /// Renderers in several threads may share a device: their frames take turns. Without validation each may have a device of
    /// its own. Under validation a process has one device at a time, as the layer breaks with two: a second call gives the same
    /// device, with the messages of all who use it.
    ///
    /// # Errors
    /// [`NotOpened`], or what the driver answers.
    pub fn open(choice: &DeviceChoice, validate: bool) -> Result<Arc<Self>> {
        Self::open_alone(choice, validate.then(|| Wish::Plain(choice.clone())), false)
    }

    /// The same, and what is submitted is cut into short pieces, as beside a window.
    ///
    /// # Errors
    /// As [`Device::open`].
    pub fn open_taking_turns(choice: &DeviceChoice, validate: bool) -> Result<Arc<Self>> {
        Self::open_alone(choice, validate.then(|| Wish::TakingTurns(choice.clone())), true)
    }

    fn open_alone(choice: &DeviceChoice, validated: Option<Wish>, turns: bool) -> Result<Arc<Self>> {
        let turn = match validated.map(take).transpose()? {
            Some(Validated::Shared(device)) => return Ok(device),
            Some(Validated::Mine(turn)) => Some(turn),
            None => None,
        };
        let is_validated = turn.is_some();
        let right = turn.map(|turn| Box::new(turn) as RightToValidate);
        let device = Self::open_on(Instance::new(right, &[])?, choice, None, turns)?;
        if is_validated {
            share(&device);
        }
        Ok(device)
    }
}
