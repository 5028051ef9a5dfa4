//! Errors without the name of the temporary file, which differs at every run.

use std::io;

/// The same error without the path that `tempfile` adds to it.
pub fn without_name(error: io::Error) -> io::Error {
    // The system's own errors carry nothing; what carries something and names a path has had it added.
    let text = error.to_string();
    match text.rsplit_once(" at path ") {
        Some((words, _)) if error.get_ref().is_some() => io::Error::new(error.kind(), words.to_owned()),
        _ => error,
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::without_name;

    #[test]
    fn the_name_of_a_temporary_file_is_left_out() {
        let error = tempfile::Builder::new().prefix(".x-").tempfile_in("/no/such/folder").unwrap_err();
        assert!(error.to_string().contains(".x-"));
        let plain = without_name(error);
        assert_eq!(plain.kind(), io::ErrorKind::NotFound);
        assert!(!plain.to_string().contains(".x-"), "{plain}");
    }

    #[test]
    fn any_other_error_stays_as_it_is() {
        assert_eq!(without_name(io::Error::other("full")).to_string(), "full");
    }
}
