//! Decompresses pages from Zstandard frames.
//!
//! The Parquet library makes a compressor and a decompressor for each column of each row group. That takes longer than
//! decompressing most pages (5 % of scoring, and their memory), so each thread keeps one decompressor here.

use std::cell::RefCell;
use std::io::{self, Cursor};

use zstd::bulk::Decompressor;

thread_local! {
    static DECOMPRESSOR: RefCell<Option<Decompressor<'static>>> = const { RefCell::new(None) };
}

/// The bytes of a page: the first `levels` unchanged, the rest decompressed; `whole` bytes in all.
pub(crate) fn inflated(stored: &[u8], levels: usize, whole: usize) -> Result<Vec<u8>, String> {
    let (plain, frame) = stored.split_at_checked(levels).ok_or_else(|| format!("{} bytes", stored.len()))?;
    let mut page = Vec::with_capacity(whole);
    page.extend_from_slice(plain);
    // A page without values may have no frame.
    if whole > levels {
        decompress(frame, &mut page).map_err(|error| error.to_string())?;
    }
    if page.len() == whole { Ok(page) } else { Err(format!("{} bytes", page.len())) }
}

fn decompress(frame: &[u8], page: &mut Vec<u8>) -> io::Result<()> {
    DECOMPRESSOR.with_borrow_mut(|kept| {
        let decompressor = match kept {
            Some(decompressor) => decompressor,
            None => kept.insert(Decompressor::new()?),
        };
        let end = page.len() as u64;
        let mut rest = Cursor::new(page);
        rest.set_position(end);
        decompressor.decompress_to_buffer(frame, &mut rest).map(drop)
    })
}

#[cfg(test)]
mod tests {
    use super::inflated;

    #[test]
    fn a_page_is_its_levels_and_its_frame_and_nothing_else() {
        let frame = zstd::bulk::compress(b"values of a page", 1).unwrap();
        let stored = [b"levels", &frame[..]].concat();
        assert_eq!(inflated(&stored, 6, 22).as_deref(), Ok(&b"levelsvalues of a page"[..]));
        assert_eq!(inflated(b"levels", 6, 6).as_deref(), Ok(&b"levels"[..]), "no frame at all");
        assert_eq!(inflated(&stored, 6, 23), Err("22 bytes".to_owned()));
        assert_eq!(inflated(b"leve", 6, 22), Err("4 bytes".to_owned()));
        for (found, stored) in
            [("too small", &stored[..]), ("incorrect", &stored[..20]), ("Unknown frame", b"levels and no frame")]
        {
            let error = inflated(stored, 6, 21).unwrap_err();
            assert!(error.contains(found), "{error}");
        }
        // Each of these leaves the context usable.
        assert!(inflated(&stored, 6, 22).is_ok());
    }
}
