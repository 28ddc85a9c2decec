//! Atomic file writes (a temporary file renamed over the target), and error messages of file operations.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, ensure};
use tempfile::{Builder, NamedTempFile};

/// The cause of a failed file operation in a few words, for the end of a sentence.
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

/// A failed file operation, for downcasting an [`anyhow::Error`].
#[derive(Debug)]
pub struct Failed(io::Error);

impl std::fmt::Display for Failed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&cause(&self.0))
    }
}

impl std::error::Error for Failed {}

/// Whether an error means a full disk or an exceeded quota: a later attempt may succeed.
#[must_use]
pub fn is_full(error: &anyhow::Error) -> bool {
    let full = |error: &io::Error| matches!(error.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded);
    let of = |cause: &(dyn std::error::Error + 'static)| {
        cause.downcast_ref::<Failed>().map(|failed| full(&failed.0)).or_else(|| cause.downcast_ref().map(full))
    };
    error.chain().filter_map(of).any(|is_full| is_full)
}

/// Reads the content of `path`; the error is one sentence.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let bytes = File::open(path).and_then(|mut file| {
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(bytes)
    });
    bytes.map_err(|error| anyhow!("reading {}: {}", path.display(), cause(&error)))
}

/// Replaces the content of `path` with `bytes` atomically: on failure the old content remains.
///
/// A symbolic link is followed and its target is replaced. A device or pipe is written to directly, because renaming
/// over `/dev/null` would replace the device. A new file gets default permissions, and an existing file keeps its
/// permissions. The bytes are not synchronised to the disk: other programs never see a partial file, but a power
/// failure may lose it.
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
        // Renaming would bypass the write protection of an existing file.
        OpenOptions::new().write(true).open(path).map_err(plain)?;
    }
    let target = if before.is_some() { fs::canonicalize(path).map_err(plain)? } else { path.to_path_buf() };
    let mut beside = beside(&target)?;
    beside.write_all(bytes).map_err(plain)?;
    if let Some(found) = before {
        beside.as_file().set_permissions(found.permissions()).map_err(plain)?;
    }
    // The error of a failed persist holds the temporary file; dropping it removes the file.
    beside.persist(&target).map_err(|error| plain(error.error))?;
    Ok(())
}

/// Checks before a long render that its output can be written.
///
/// Creates a file in the folder of `path` and removes it; an existing file is opened for writing and not changed.
pub fn check_writable(path: &Path) -> Result<()> {
    let check = || -> Result<()> {
        match fs::metadata(path) {
            Ok(found) => {
                ensure!(!found.is_dir(), "it is a folder");
                // Whoever reads a pipe would see its end.
                #[cfg(unix)]
                if std::os::unix::fs::FileTypeExt::is_fifo(&found.file_type()) {
                    return Ok(());
                }
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
    check().with_context(|| format!("cannot write {}", path.display()))
}

/// A temporary file in the folder of `target` that is removed unless it is persisted.
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
        // tempfile requests mode 0600; with 0666 the umask decides, as for other new files.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(&folder).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => anyhow!("the folder {} does not exist", folder.display()),
        io::ErrorKind::NotADirectory => anyhow!("{} is not a folder", folder.display()),
        // tempfile appends its own file name to the error, which would confuse.
        io::ErrorKind::PermissionDenied
        | io::ErrorKind::StorageFull
        | io::ErrorKind::QuotaExceeded
        | io::ErrorKind::ReadOnlyFilesystem => anyhow!(Failed(error)),
        kind => anyhow!("no file can be created in {}: {}", folder.display(), kind),
    })
}

/// Folder for reproducible data: `etalon` in `$XDG_CACHE_HOME` or `~/.cache`.
pub fn cache_folder() -> Option<PathBuf> {
    let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".cache"));
    let folder = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from).or_else(home);
    folder.map(|folder| folder.join("etalon"))
}

/// Folder of the user's settings, by the XDG base directory specification; `None` where there is no home.
pub fn config_folder() -> Option<PathBuf> {
    let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".config"));
    let folder = std::env::var_os("XDG_CONFIG_HOME").map(PathBuf::from).or_else(home);
    folder.map(|folder| folder.join("etalon"))
}

/// Hash of an output as 32 hexadecimal digits: XXH3 with 128 bits, seed 0, most significant digit first.
///
/// Equal bytes have equal hashes on all machines and in all versions. The hash identifies files and is not
/// cryptographic.
pub fn hash(bytes: &[u8]) -> String {
    format!("{:032x}", xxhash_rust::xxh3::xxh3_128(bytes))
}
