//! The folder that a URI of a master names.

use std::path::PathBuf;

/// The path of a `file` URI.
///
/// # Errors
/// If it is no URI of a local file.
pub(crate) fn path(uri: &str) -> Result<PathBuf, String> {
    let refused =
        || format!("resource location {uri:?}: must be a URI like file:///folder/resources");
    let rest = uri.strip_prefix("file:").ok_or_else(refused)?;
    let path = match rest.strip_prefix("//") {
        Some(with_host) => with_host.strip_prefix("localhost").unwrap_or(with_host),
        None => rest,
    };
    if !path.starts_with('/') {
        return Err(refused());
    }
    String::from_utf8(decoded(path))
        .map(PathBuf::from)
        .map_err(|_| refused())
}

/// With each `%` and two hexadecimal digits as the byte that they are.
fn decoded(text: &str) -> Vec<u8> {
    let mut decoded = Vec::new();
    let mut rest = text.as_bytes();
    while let [first, others @ ..] = rest {
        let byte = match others {
            [high, low, ..] if *first == b'%' => hexadecimal(*high, *low),
            _ => None,
        };
        decoded.push(byte.unwrap_or(*first));
        rest = if byte.is_some() { &others[2..] } else { others };
    }
    decoded
}

fn hexadecimal(high: u8, low: u8) -> Option<u8> {
    let digit = |byte| char::from(byte).to_digit(16);
    Some((16 * digit(high)? + digit(low)?) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_of_uris() {
        for (uri, expected) in [
            ("file:///tmp/a%20b/resources", "/tmp/a b/resources"),
            ("file:/tmp/r", "/tmp/r"),
            ("file://localhost/tmp/100%/r", "/tmp/100%/r"),
            ("file:///tmp/%C3%A4/", "/tmp/\u{e4}/"),
        ] {
            assert_eq!(path(uri), Ok(PathBuf::from(expected)));
        }
        for uri in [
            "",
            "/tmp/r",
            "https://host/r",
            "file://host",
            "file:r",
            "file:///%FF",
        ] {
            assert!(path(uri).unwrap_err().contains("file:///"), "{uri}");
        }
    }
}
