//! Optimised SPIR-V of earlier builds, by what it was made from. Optimisation takes most of the time of a build, and
//! one edit changes few programs, and a comment none.

use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher as _};
use std::path::{Path, PathBuf};

/// Largest number of entries: some five builds with all shaders changed. Beyond it, the oldest are removed.
const MOST: usize = 3000;

/// A folder of compiled code. Clones use the same folder.
#[derive(Debug, Clone, Default)]
pub(crate) struct Cache {
    folder: Option<PathBuf>,
}

/// What code was made from: the compiler's unoptimised module, which comments do not change, and all settings.
pub(crate) struct Key {
    // Two hashes of 64 bits with different beginnings: a chance of 1e-33 that two of 3000 entries are confused.
    hashes: [DefaultHasher; 2],
}

impl Key {
    pub(crate) fn new() -> Self {
        let mut hashes = [DefaultHasher::new(), DefaultHasher::new()];
        hashes[1].write_u8(1);
        Self { hashes }
    }

    pub(crate) fn add(&mut self, part: &(impl Hash + ?Sized)) {
        self.hashes.iter_mut().for_each(|hash| part.hash(hash));
    }

    fn name(&self) -> String {
        let [a, b] = self.hashes.each_ref().map(DefaultHasher::finish);
        format!("{a:016x}{b:016x}")
    }
}

impl Cache {
    /// The cache beside cargo's folder of build scripts, which all sets of features and all checks share; none where
    /// `out_dir` is no folder of cargo's.
    pub(crate) fn beside(out_dir: &Path) -> Self {
        let is_cargos = out_dir.ancestors().nth(2).is_some_and(|folder| folder.ends_with("build"));
        let folder = out_dir.ancestors().nth(3).filter(|_| is_cargos).map(|folder| folder.join("shader-cache"));
        Self { folder: folder.filter(|folder| fs::create_dir_all(folder).is_ok()) }
    }

    /// The code of a key, from an earlier build or made now. A file that cannot be read or written costs time alone.
    pub(crate) fn words<E>(&self, key: &Key, make: impl FnOnce() -> Result<Vec<u32>, E>) -> Result<Vec<u32>, E> {
        let Some(path) = self.folder.as_ref().map(|folder| folder.join(key.name())) else { return make() };
        let known = fs::read(&path).ok().filter(|bytes| !bytes.is_empty() && bytes.len() % 4 == 0);
        if let Some(bytes) = known {
            return Ok(bytes
                .chunks_exact(4)
                .map(|word| u32::from_ne_bytes([word[0], word[1], word[2], word[3]]))
                .collect());
        }
        let words = make()?;
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_ne_bytes()).collect();
        // Whole or absent: another build may read at the same time.
        let part = path.with_extension(format!("{}.part", std::process::id()));
        if fs::write(&part, bytes).is_ok() {
            let _ = fs::rename(&part, &path);
        }
        Ok(words)
    }

    /// Removes the oldest entries of a cache that has grown large.
    pub(crate) fn trim(&self) {
        let Some(entries) = self.folder.as_ref().and_then(|folder| fs::read_dir(folder).ok()) else { return };
        let aged = |entry: fs::DirEntry| Some((entry.metadata().ok()?.modified().ok()?, entry.path()));
        let mut all: Vec<_> = entries.filter_map(|entry| aged(entry.ok()?)).collect();
        all.sort();
        for (_, path) in all.iter().take(all.len().saturating_sub(MOST)) {
            let _ = fs::remove_file(path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_is_made_once_for_each_text() {
        let root = std::env::temp_dir().join(format!("etalon-reflect-{}", std::process::id()));
        let out = root.join("debug/build/etalon-1/out");
        fs::create_dir_all(&out).expect("a folder");
        let cache = Cache::beside(&out);
        let key = |texts: &[&str]| {
            let mut key = Key::new();
            texts.iter().for_each(|text| key.add(*text));
            key
        };
        let made = |texts: &[&str], words: &[u32]| cache.words(&key(texts), || Ok::<_, ()>(words.to_vec()));
        assert_eq!(made(&["a", "b"], &[1, 2]), Ok(vec![1, 2]));
        assert_eq!(made(&["a", "b"], &[3]), Ok(vec![1, 2]), "what was made before");
        assert_eq!(made(&["ab"], &[4]), Ok(vec![4]), "where a text ends counts");
        assert_eq!(cache.words(&key(&["c"]), || Err("no")), Err("no"));
        assert_eq!(made(&["c"], &[5]), Ok(vec![5]), "a failure is not kept");
        let nowhere = Cache::beside(&root);
        assert_eq!(nowhere.words(&key(&["a", "b"]), || Ok::<_, ()>(vec![6])), Ok(vec![6]));
        fs::remove_dir_all(&root).expect("a folder");
    }
}
