//! Generated blocks of Markdown pages: the text between `<!-- generated: NAME -->` and `<!-- end -->`.

use std::path::Path;

/// `text` with the block replaced; `None` if the page has no such block.
///
/// # Panics
/// The block has no end.
#[must_use]
pub fn replaced(text: &str, name: &str, block: &str) -> Option<String> {
    let begin = format!("<!-- generated: {name} -->\n");
    let at = text.find(&begin)? + begin.len();
    let end = at + text[at..].find("<!-- end -->").unwrap_or_else(|| panic!("the block {name} has no end"));
    Some(format!("{}\n{}\n\n{}", &text[..at], block.trim_end(), &text[end..]))
}

/// Asserts that a page has this block; if the environment variable `ETALON_BLESS` is set, writes the block instead.
///
/// # Panics
/// The page has no such block, or a different one.
pub fn says(page: &Path, name: &str, block: &str) {
    let text = std::fs::read_to_string(page).unwrap_or_else(|error| panic!("{}: {error}", page.display()));
    let fresh = replaced(&text, name, block).unwrap_or_else(|| panic!("{} has no block {name}", page.display()));
    if fresh != text && std::env::var_os("ETALON_BLESS").is_some() {
        std::fs::write(page, &fresh).expect("a page is written");
        return;
    }
    let line = text.lines().zip(fresh.lines()).find(|(old, new)| old != new);
    assert!(fresh == text, "{}, {name}: run the test with ETALON_BLESS=1; {line:?}", page.display());
}
