//! The driver's pipeline cache, kept in a file for each device and driver, beside what the driver keeps itself: later
//! processes do not compile again.
//!
//! Read the Vulkan specification, section Pipeline Cache. Drivers check the header of what they are given, and trust
//! the rest: a file therefore begins with a hash of its content, and one that was cut off or changed is not used. Two
//! processes may write the same file: each joins what the other has written to its own, and replaces the file whole.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::{fs, io};

use ash::vk;
use xxhash_rust::xxh3::xxh3_128;

/// Largest content of a file that is read or written: two thousand plans of RADV.
const MOST_BYTES: usize = 256 << 20;
/// Bytes of the hash before the content.
const HASH: usize = size_of::<u128>();
/// Bytes of the header that the specification demands (`VkPipelineCacheHeaderVersionOne`).
const HEADER: usize = 32;

static FOLDER: OnceLock<PathBuf> = OnceLock::new();

/// Keeps the compiled pipelines of the devices that this process opens from now on in files below `folder`, one for
/// each device and driver. Without this call nothing is read or written. The first call decides.
pub fn keep_pipelines_in(folder: PathBuf) {
    let _ = FOLDER.set(folder);
}

/// A device's pipeline cache, and its file.
pub(super) struct KeptPipelines {
    pub(super) raw: vk::PipelineCache,
    file: Option<PathBuf>,
    /// Hash of the content that was loaded.
    loaded: Option<u128>,
    /// A pipeline was created that the content did not have.
    compiled: AtomicBool,
}

impl KeptPipelines {
    /// Loads the file of a device. What cannot be read counts as empty.
    pub(super) fn open(device: &ash::Device, properties: &vk::PhysicalDeviceProperties) -> Self {
        let compiled = AtomicBool::new(false);
        let none = Self { raw: vk::PipelineCache::null(), file: None, loaded: None, compiled };
        let Some(folder) = FOLDER.get() else { return none };
        let file = folder.join(file_name(properties));
        let content = read(&file).unwrap_or_else(|error| {
            if error.kind() != io::ErrorKind::NotFound {
                tracing::info!("{}: not used as pipeline cache: {error}", file.display());
            }
            Vec::new()
        });
        match create(device, &content) {
            Ok(raw) => {
                let loaded = (!content.is_empty()).then(|| xxh3_128(&content));
                Self { raw, file: Some(file), loaded, ..none }
            }
            Err(error) => {
                tracing::info!("{}: not used as pipeline cache: {error}", file.display());
                none
            }
        }
    }

    /// Notes what the driver says about a pipeline that it has created with this cache.
    pub(super) fn note(&self, feedback: vk::PipelineCreationFeedback) {
        let found = vk::PipelineCreationFeedbackFlags::VALID
            | vk::PipelineCreationFeedbackFlags::APPLICATION_PIPELINE_CACHE_HIT;
        if !feedback.flags.contains(found) {
            self.compiled.store(true, Ordering::Relaxed);
        }
    }

    /// Writes the file if there is more to write than was loaded, and destroys the cache. A file that cannot be written
    /// is a matter of speed alone: it is logged.
    ///
    /// # Safety
    /// `device` is that of [`KeptPipelines::open`], and creates no pipelines any more.
    pub(super) unsafe fn close(&mut self, device: &ash::Device) {
        if let Some(file) = self.file.take() {
            // SAFETY: guaranteed by the caller.
            unsafe {
                let compiled = *self.compiled.get_mut();
                if let Err(error) = if compiled { self.save(device, &file) } else { Ok(()) } {
                    tracing::info!("{}: the pipeline cache was not written: {error}", file.display());
                }
                device.destroy_pipeline_cache(self.raw, None);
            }
        }
    }

    /// # Safety
    /// As for [`KeptPipelines::close`].
    unsafe fn save(&self, device: &ash::Device, file: &Path) -> io::Result<()> {
        let refused = |error: vk::Result| io::Error::other(error.to_string());
        // SAFETY: both caches belong to the device, and nobody else uses them.
        let content = unsafe {
            let own = device.get_pipeline_cache_data(self.raw).map_err(refused)?;
            // lavapipe and SwiftShader keep nothing but the header.
            if own.len() <= HEADER || self.loaded == Some(xxh3_128(&own)) {
                return Ok(());
            }
            match read(file) {
                Ok(other) if Some(xxh3_128(&other)) != self.loaded => {
                    let other = create(device, &other).map_err(refused)?;
                    let joined = device.merge_pipeline_caches(self.raw, &[other]);
                    device.destroy_pipeline_cache(other, None);
                    joined.map_err(refused)?;
                    device.get_pipeline_cache_data(self.raw).map_err(refused)?
                }
                _ => own,
            }
        };
        write(file, &content)
    }
}

/// Name of the file of a device and driver; nothing that one of them has compiled is offered to another.
fn file_name(properties: &vk::PhysicalDeviceProperties) -> String {
    let uuid: String = properties.pipeline_cache_uuid.iter().map(|byte| format!("{byte:02x}")).collect();
    let vk::PhysicalDeviceProperties { vendor_id, device_id, driver_version, .. } = properties;
    format!("{vendor_id:04x}-{device_id:04x}-{driver_version:08x}-{uuid}.pipelines")
}

fn create(device: &ash::Device, content: &[u8]) -> Result<vk::PipelineCache, vk::Result> {
    let info = vk::PipelineCacheCreateInfo::default().initial_data(content);
    // SAFETY: the content is as the driver gave it, by its hash, and the driver checks the header.
    unsafe { device.create_pipeline_cache(&info, None) }
}

/// The content of a file.
///
/// # Errors
/// It cannot be read, or is not what was written.
fn read(file: &Path) -> io::Result<Vec<u8>> {
    if fs::metadata(file)?.len() > (HASH + MOST_BYTES) as u64 {
        return Err(io::Error::other("it is too large"));
    }
    let mut bytes = fs::read(file)?;
    let content = bytes.split_off(bytes.len().min(HASH));
    if bytes != xxh3_128(&content).to_le_bytes() || content.len() <= HEADER {
        return Err(io::Error::other("it is damaged"));
    }
    Ok(content)
}

/// Replaces a file as a whole.
///
/// # Errors
/// It cannot be written.
fn write(file: &Path, content: &[u8]) -> io::Result<()> {
    if content.len() > MOST_BYTES {
        return Err(io::Error::other("it is too large"));
    }
    let folder = file.parent().ok_or_else(|| io::Error::other("it has no folder"))?;
    fs::create_dir_all(folder)?;
    let mut beside = tempfile::NamedTempFile::new_in(folder)?;
    beside.write_all(&xxh3_128(content).to_le_bytes())?;
    beside.write_all(content)?;
    beside.persist(file)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_as_it_was_written_or_not_at_all() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("below/driver.pipelines");
        let content: Vec<u8> = (0..1000_u32).map(|i| i as u8).collect();
        assert_eq!(read(&file).map_err(|error| error.kind()), Err(io::ErrorKind::NotFound));
        write(&file, &content).expect("a written file");
        assert_eq!(read(&file).expect("the file"), content);
        let whole = fs::read(&file).expect("the file");
        for at in [0, 15, 16, 500, whole.len() - 1] {
            let mut changed = whole.clone();
            changed[at] ^= 1;
            fs::write(&file, &changed).expect("a written file");
            assert!(read(&file).is_err(), "byte {at} changed");
            fs::write(&file, &whole[..at]).expect("a written file");
            assert!(read(&file).is_err(), "{at} bytes");
        }
        // A header alone is no pipeline.
        write(&file, &content[..HEADER]).expect("a written file");
        assert!(read(&file).is_err());
        // What is in the way stays.
        fs::remove_file(&file).expect("removed");
        fs::create_dir(&file).expect("a folder");
        assert!(read(&file).is_err() && write(&file, &content).is_err() && file.is_dir());
        assert_eq!(fs::read_dir(file.parent().expect("a folder")).expect("listed").count(), 1, "nothing beside");
    }

    #[test]
    fn devices_and_drivers_have_files_of_their_own() {
        let one = vk::PhysicalDeviceProperties { vendor_id: 0x1002, device_id: 0x73bf, ..Default::default() };
        let uuid = [7; vk::UUID_SIZE];
        let others = [
            vk::PhysicalDeviceProperties { vendor_id: 0x10de, ..one },
            vk::PhysicalDeviceProperties { device_id: 1, ..one },
            vk::PhysicalDeviceProperties { driver_version: 1, ..one },
            vk::PhysicalDeviceProperties { pipeline_cache_uuid: uuid, ..one },
        ];
        let name = file_name(&one);
        assert!(name.starts_with("1002-73bf-00000000-") && others.iter().all(|other| file_name(other) != name));
    }
}
