//! Files that are either whole or absent: bytes are written beside the target, then renamed over it.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, ensure};
use tempfile::{Builder, NamedTempFile};

/// Says in a few words why an operation on a file failed, for the end of a sentence.
pub fn cause(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::PermissionDenied => "permission denied".into(),
        io::ErrorKind::NotFound => "no such file or folder".into(),
        io::ErrorKind::IsADirectory => "it is a folder".into(),
        io::ErrorKind::NotADirectory => "a part of the path is not a folder".into(),
        io::ErrorKind::StorageFull => "no space left on the disk".into(),
        io::ErrorKind::ReadOnlyFilesystem => "the file system is read-only".into(),
        io::ErrorKind::UnexpectedEof => "the file ends too early".into(),
        _ => error.to_string(),
    }
}

/// Why an operation on a file failed: what a caller may look for in an [`anyhow::Error`].
#[derive(Debug)]
pub struct Failed(io::Error);

impl std::fmt::Display for Failed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&cause(&self.0))
    }
}

impl std::error::Error for Failed {}

/// Whether an error comes of a disk, or of somebody's share of it, that is full: the same may be possible later.
#[must_use]
pub fn is_full(error: &anyhow::Error) -> bool {
    let full = |error: &Failed| matches!(error.0.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded);
    error.chain().any(|cause| cause.downcast_ref().is_some_and(full))
}

/// Whole contents of `path`, with one sentence when it cannot be read.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let bytes = File::open(path).and_then(|mut file| {
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(bytes)
    });
    bytes.map_err(|error| anyhow!("reading {}: {}", path.display(), cause(&error)))
}

/// Makes `path` hold exactly `bytes`, or leaves it as it was.
///
/// A link is followed and what it points at is replaced; a device or pipe is written to directly, because renaming
/// over `/dev/null` would replace the device. A new file gets the permissions that an ordinary new file gets, an
/// existing one keeps its own. The bytes are not forced to the disk: the promise is about other programs that look,
/// not about power cuts.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    write_inner(path, bytes).with_context(|| format!("writing {}", path.display()))
}

fn write_inner(path: &Path, bytes: &[u8]) -> Result<()> {
    let plain = |error: io::Error| anyhow!(Failed(error));
    let before = match fs::metadata(path) {
        Ok(found) => Some(found),
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => return Err(plain(error)),
    };
    if let Some(found) = &before {
        ensure!(!found.is_dir(), "it is a folder");
        if !found.is_file() {
            return OpenOptions::new().write(true).open(path).and_then(|mut file| file.write_all(bytes)).map_err(plain);
        }
        // Renaming would get past a write-protected file without asking.
        OpenOptions::new().write(true).open(path).map_err(plain)?;
    }
    let target = if before.is_some() { fs::canonicalize(path).map_err(plain)? } else { path.to_path_buf() };
    let mut beside = beside(&target)?;
    beside.write_all(bytes).map_err(plain)?;
    if let Some(found) = before {
        beside.as_file().set_permissions(found.permissions()).map_err(plain)?;
    }
    // A failed persist hands the temporary file back inside the error; dropping that removes it.
    beside.persist(&target).map_err(|error| plain(error.error))?;
    Ok(())
}

/// Finds out before a long render whether its output can be written at the end.
///
/// Creates a file in the folder of `path` and removes it again; an existing file is opened for writing, unchanged.
pub fn check_writable(path: &Path) -> Result<()> {
    let check = || -> Result<()> {
        match fs::metadata(path) {
            Ok(found) => {
                ensure!(!found.is_dir(), "it is a folder");
                OpenOptions::new().write(true).open(path).map_err(|error| anyhow!(cause(&error)))?;
                if found.is_file() {
                    beside(&fs::canonicalize(path).map_err(|error| anyhow!(cause(&error)))?)?;
                }
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                beside(path)?;
            }
            Err(error) => return Err(anyhow!(cause(&error))),
        }
        Ok(())
    };
    check().with_context(|| format!("checking that {} can be written", path.display()))
}

/// An empty file in the folder of `target` that removes itself unless it is kept.
fn beside(target: &Path) -> Result<NamedTempFile> {
    ensure!(target.file_name().is_some(), "the path names no file");
    let folder = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
        _ => PathBuf::from("."),
    };
    let mut builder = Builder::new();
    builder.prefix(".etalon-").suffix(".part");
    #[cfg(unix)]
    {
        // tempfile asks for 0600; with 0666 the umask decides, as for every other new file.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(&folder).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => anyhow!("the folder {} does not exist", folder.display()),
        io::ErrorKind::NotADirectory => anyhow!("{} is not a folder", folder.display()),
        // tempfile appends its own file name to the text of the error, which would only confuse.
        io::ErrorKind::PermissionDenied
        | io::ErrorKind::StorageFull
        | io::ErrorKind::QuotaExceeded
        | io::ErrorKind::ReadOnlyFilesystem => anyhow!(Failed(error)),
        kind => anyhow!("no file can be created in {}: {}", folder.display(), kind),
    })
}

/// Where the program keeps what it can make again: `etalon` in `$XDG_CACHE_HOME` or `~/.cache`.
pub fn cache_folder() -> Option<PathBuf> {
    let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".cache"));
    let folder = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from).or_else(home);
    folder.map(|folder| folder.join("etalon"))
}

/// Hash of an output as 32 hexadecimal digits: XXH3 with 128 bits, seed 0, most significant digit first.
///
/// The same bytes give the same digits on every machine and in every version; it tells files apart and proves nothing
/// against an attacker.
pub fn hash(bytes: &[u8]) -> String {
    format!("{:032x}", xxhash_rust::xxh3::xxh3_128(bytes))
}
