//! Opening of logical devices, with at most one device per process under validation.
//!
//! Read the Vulkan specification, chapter Devices and Queues, and the Khronos validation layer's documentation. The
//! layer keeps its instances and devices in a table. Every call reads the table without a lock, and creation or
//! destruction of a device changes it (issue 4391 of Vulkan-ValidationLayers; seen with helgrind in 1.3.239). Two
//! validated devices in two threads corrupted the heap in some runs of hundreds. A process therefore has one validated
//! device, and a second request gets the same one.

use std::sync::{Arc, Condvar, Mutex, Weak};

use anyhow::{Result, bail};

use super::choice::DeviceChoice;
use super::device::{Device, Instance, RightToValidate, lock};
use super::error::NotOpened;

struct ValidationSlot {
    wish: Wish,
    /// A dangling reference while the device is being created, and after its last owner has dropped it.
    device: Weak<Device>,
}

/// The kind of device that a caller requested.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Wish {
    Plain(DeviceChoice),
    TakingTurns(DeviceChoice),
    /// A device that presents to a window of its own, with time-sliced submission.
    #[cfg(feature = "window")]
    Window(DeviceChoice),
}

impl Wish {
    fn is_shared(&self) -> bool {
        matches!(self, Self::Plain(_) | Self::TakingTurns(_))
    }
}

static SLOT: Mutex<Option<ValidationSlot>> = Mutex::new(None);
static FREED: Condvar = Condvar::new();

/// The right to own the validated device; dropping the lease returns it.
struct ValidationLease(());

impl Drop for ValidationLease {
    fn drop(&mut self) {
        *lock(&SLOT) = None;
        FREED.notify_all();
    }
}

/// The existing validated device, or the right to create it.
enum Validated {
    Shared(Arc<Device>),
    Mine(ValidationLease),
}

/// Waits while another thread creates or destroys the validated device.
///
/// # Errors
/// When the process has a validated device of another kind.
fn take(wish: Wish) -> Result<Validated> {
    let mut slot = lock(&SLOT);
    loop {
        match &*slot {
            None => break,
            Some(other) => match other.device.upgrade() {
                Some(device) if other.wish == wish && wish.is_shared() => return Ok(Validated::Shared(device)),
                Some(device) => {
                    let has = format!("{:?}", other.wish);
                    // The last owner of the device returns its lease, which locks the slot.
                    drop(slot);
                    let (device, wanted) = (device.info().name.clone(), format!("{wish:?}"));
                    bail!(NotOpened::Validated { device, has, wanted })
                }
                None => slot = FREED.wait(slot).unwrap_or_else(std::sync::PoisonError::into_inner),
            },
        }
    }
    *slot = Some(ValidationSlot { wish, device: Weak::new() });
    Ok(Validated::Mine(ValidationLease(())))
}

/// Publishes a device that was created under a [`ValidationLease`].
pub(super) fn share(device: &Arc<Device>) {
    if let Some(slot) = &mut *lock(&SLOT) {
        slot.device = Arc::downgrade(device);
    }
    FREED.notify_all();
}

/// The right to create the validated device of a window, which is not shared.
///
/// # Errors
/// When the process has another validated device.
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
    /// Renderers in several threads may share a device: the device draws one frame at a time. Without validation each
    /// renderer may have a device of its own. Under validation a process has one device at a time, because the layer
    /// breaks with two: a second call returns the same device, and its messages are those of all users.
    ///
    /// # Errors
    /// [`NotOpened`], or the error of the driver.
    pub fn open(choice: &DeviceChoice, validate: bool) -> Result<Arc<Self>> {
        Self::open_alone(choice, validate.then(|| Wish::Plain(choice.clone())), false)
    }

    /// Opens a device as [`Device::open`] does, with short submissions, as beside a window: for a device that was lost
    /// under longer ones.
    ///
    /// # Errors
    /// As [`Device::open`].
    pub fn open_time_sliced(choice: &DeviceChoice, validate: bool) -> Result<Arc<Self>> {
        Self::open_alone(choice, validate.then(|| Wish::TakingTurns(choice.clone())), true)
    }

    fn open_alone(choice: &DeviceChoice, validated: Option<Wish>, time_slices: bool) -> Result<Arc<Self>> {
        let turn = match validated.map(take).transpose()? {
            Some(Validated::Shared(device)) => return Ok(device),
            Some(Validated::Mine(turn)) => Some(turn),
            None => None,
        };
        let is_validated = turn.is_some();
        let right = turn.map(|turn| Box::new(turn) as RightToValidate);
        let device = Self::open_on(Arc::new(Instance::new(right, &[])?), choice, None, time_slices)?;
        if is_validated {
            share(&device);
        }
        Ok(device)
    }
}
