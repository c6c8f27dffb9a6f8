//! Paths in place of URLs in a command line.
//!
//! In: arguments, a URL, a path. Out: the arguments with the path wherever the URL was a value.

use std::ffi::OsString;

/// Returns arguments with a path in place of a URL, which is an argument of its own or the end of an option's.
pub(super) fn replaced(arguments: &[OsString], url: &str, path: &str) -> Vec<OsString> {
    let replaced = |argument: &OsString| {
        let before = argument.to_str().and_then(|text| text.strip_suffix(url));
        match before.filter(|before| before.is_empty() || before.starts_with('-')) {
            Some(before) => format!("{before}{path}").into(),
            None => argument.clone(),
        }
    };
    arguments.iter().map(replaced).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_are_replaced_wherever_options_end_in_them() {
        let all = ["gs4d", "s3://a/b", "--data=s3://a/b", "-os3://a/b", "s3://a/b.pth", "x-s3://a/b"];
        let expected = ["gs4d", "/p", "--data=/p", "-o/p", "s3://a/b.pth", "x-s3://a/b"].map(OsString::from);
        assert_eq!(replaced(&all.map(OsString::from), "s3://a/b", "/p"), expected, "whole values alone");
    }
}
