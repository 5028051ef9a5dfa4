//! Errors of temporary files, without the name of the file, which differs at every run and which nobody asked for.

use std::io;

/// The system's own error.
pub fn without_name(error: io::Error) -> io::Error {
    let inner = error.get_ref().and_then(|inner| inner.source());
    let code = inner.and_then(|inner| inner.downcast_ref::<io::Error>()).and_then(io::Error::raw_os_error);
    code.map_or(error, io::Error::from_raw_os_error)
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
