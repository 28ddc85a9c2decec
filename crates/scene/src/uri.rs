//! The content of URIs: `data:`, or paths relative to a file.
//!
//! Read glTF 2.0 section 2.8 (URIs) and RFC 4648 (Base64).

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail, ensure};

/// A URI shortened for messages: `data:` URIs can be megabytes.
pub(crate) fn short_uri(uri: &str) -> String {
    if uri.chars().count() <= 80 { uri.to_owned() } else { format!("{}…", uri.chars().take(60).collect::<String>()) }
}

/// The content of a URI; paths are relative to `folder`.
pub(crate) fn resolve(uri: &str, folder: &Path) -> Result<Vec<u8>> {
    if let Some(data) = uri.strip_prefix("data:") {
        return decode_data_uri(data).with_context(|| format!("the URI \"{}\"", short_uri(uri)));
    }
    let path = file(uri, folder)?;
    fs::read(&path).map_err(|error| anyhow!("{}: {}", path.display(), etalon_image::file::cause(&error)))
}

/// The file that a URI other than `data:` names; paths are relative to `folder`.
pub(crate) fn file(uri: &str, folder: &Path) -> Result<PathBuf> {
    if let Some((scheme, _)) = uri.split_once(':')
        && scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    {
        bail!("the URI \"{}\" has the scheme \"{scheme}\"; only data: and relative files are read", short_uri(uri));
    }
    let relative = percent_encoding::percent_decode_str(uri)
        .decode_utf8()
        .with_context(|| format!("the URI \"{}\" is not UTF-8", short_uri(uri)))?;
    ensure!(
        !Path::new(relative.as_ref()).has_root(),
        "the URI \"{}\" is an absolute path; only relative ones are read",
        short_uri(uri)
    );
    Ok(folder.join(relative.as_ref()))
}

fn decode_data_uri(data: &str) -> Result<Vec<u8>> {
    let (head, body) = data.split_once(',').context("there is no comma before the data")?;
    if head.ends_with(";base64") {
        if body.contains('%') {
            let plain: Vec<u8> = percent_encoding::percent_decode_str(body).collect();
            return decode_base64(&plain);
        }
        decode_base64(body.as_bytes())
    } else {
        Ok(percent_encoding::percent_decode_str(body).collect())
    }
}

/// Decodes Base64 of RFC 4648, standard or URL alphabet, padding optional.
fn decode_base64(text: &[u8]) -> Result<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3 + 3);
    let (mut bits, mut count) = (0_u32, 0_u32);
    let end = text.iter().rposition(|&b| b != b'=').map_or(0, |i| i + 1);
    for &byte in &text[..end] {
        let value = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            b'\r' | b'\n' | b' ' | b'\t' => continue,
            _ => bail!("byte {byte:#04x} is not base64"),
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            out.push((bits >> count) as u8);
        }
    }
    ensure!(count < 6, "the base64 data ends within a byte");
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_matches_the_vectors_of_rfc_4648() {
        for (plain, coded) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy"), ("fo", "Zm8")]
        {
            assert_eq!(decode_base64(coded.as_bytes()).unwrap(), plain.as_bytes(), "{coded}");
        }
        assert_eq!(decode_base64(b"-_+/").unwrap(), [0xfb, 0xff, 0xbf]);
        assert!(decode_base64(b"Z").is_err());
        assert!(decode_base64(b"Zm9*").is_err());
    }

    #[test]
    fn plain_data_uris_are_percent_decoded() {
        assert_eq!(decode_data_uri("text/plain,a%20b").unwrap(), b"a b");
        assert!(decode_data_uri("text/plain").is_err());
    }

    #[test]
    fn a_uri_with_a_scheme_is_refused() {
        let error = format!("{:#}", resolve("https://example.org/a.bin", Path::new("")).unwrap_err());
        assert!(error.contains("https"), "{error}");
        assert!(format!("{:#}", resolve("/etc/hostname", Path::new("")).unwrap_err()).contains("absolute"));
    }
}
