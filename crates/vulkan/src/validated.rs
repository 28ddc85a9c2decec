//! One device under validation at a time.
//!
//! The validation layer keeps its instances and devices in a table that every call reads without a lock and that making or
//! destroying one of them changes (its issue 4391; seen with helgrind in 1.3.239). Two validated devices in two threads
//! broke the heap in some runs of hundreds. So a process has one: whoever asks again gets the same.

use std::sync::{Arc, Condvar, Mutex, Weak};

use anyhow::{Result, bail};

use super::device::{Device, DeviceChoice, lock};

struct Slot {
    wish: Wish,
    /// Of nothing while the device is being made, and once its last owner is gone.
    device: Weak<Device>,
}

/// What was asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Wish {
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
pub(super) struct Turn(());

impl Drop for Turn {
    fn drop(&mut self) {
        *lock(&SLOT) = None;
        FREED.notify_all();
    }
}

/// The device that there is, or the right to make it.
pub(super) enum Validated {
    Shared(Arc<Device>),
    Mine(Turn),
}

/// Waits for a device that is being made or destroyed.
///
/// # Errors
/// Where there is one of another kind.
pub(super) fn take(wish: Wish) -> Result<Validated> {
    let mut slot = lock(&SLOT);
    loop {
        match &*slot {
            None => break,
            Some(other) => match other.device.upgrade() {
                Some(device) if other.wish == wish && wish.is_shared() => return Ok(Validated::Shared(device)),
                Some(device) => bail!(
                    "this process has device \"{}\" under validation already, as {:?}: the layer cannot hold {wish:?} beside it",
                    device.info().name,
                    other.wish
                ),
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
pub(super) fn for_a_window(choice: &DeviceChoice) -> Result<Turn> {
    match take(Wish::Window(choice.clone()))? {
        Validated::Mine(turn) => Ok(turn),
        Validated::Shared(_) => unreachable!("a window's device is its own"),
    }
}
