//! Tables as CSV: the header, then one line per row.
//!
//! A spreadsheet treats text that begins like a formula as one. Such text from traces gets a leading apostrophe, which
//! [`text_of`] removes; numbers stay numbers.

use super::Table;

impl Table {
    /// As comma-separated values: the header, then the rows.
    pub fn csv(&self) -> String {
        let mut writer = ::csv::Writer::from_writer(Vec::new());
        let mut write = |record: Vec<&str>| writer.write_record(record).expect("rows of one length, written to memory");
        write(self.columns.iter().map(|column| column.heading.as_str()).collect());
        self.rows().for_each(|row| write(row.iter().map(|cell| cell.text.as_str()).collect()));
        let bytes = writer.into_inner().expect("flushing to memory does not fail");
        String::from_utf8(bytes).expect("every field is text")
    }
}

/// A text as a field; text that a spreadsheet would compute is made harmless.
pub fn text_field(text: &str) -> String {
    if is_formula(text) { format!("'{text}") } else { text.to_owned() }
}

pub fn text_of(field: &str) -> &str {
    field.strip_prefix('\'').filter(|text| is_formula(text)).unwrap_or(field)
}

fn is_formula(text: &str) -> bool {
    text.trim_start_matches('\'').starts_with(['=', '+', '-', '@', '\t', '\r'])
}

#[cfg(test)]
mod tests {
    use super::{text_field, text_of};

    #[test]
    fn formulas_are_made_harmless_and_come_back() {
        for (text, field) in [
            ("Gemma4 26B", "Gemma4 26B"),
            ("=1+1", "'=1+1"),
            ("+x", "'+x"),
            ("-x", "'-x"),
            ("@x", "'@x"),
            ("\tx", "'\tx"),
            ("'=x", "''=x"),
            ("'quoted", "'quoted"),
            ("", ""),
        ] {
            assert_eq!(text_field(text), field);
            assert_eq!(text_of(field), text);
        }
    }
}
