//! Refusals of pages that the Parquet library would read.
//!
//! Rule: if only the program refuses, it has one of these reasons; otherwise the target fails.

/// A reason, named after the expectation that was not met.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reason {
    /// The library skips unknown fields of a page header. It accepts repeated fields, and the header of another kind of
    /// page beside the page's own. An ambiguous header is refused: the checksum does not cover it.
    HeaderOfOneMeaning,
    /// The declared size is not what the codec can make of the stored bytes, or not that of the uncompressed bytes. The
    /// library believes it if the decoder does not reach the end.
    SizeOfPage,
    /// Pages with more values than the row group has rows. The library stops reading at the last row.
    RowsOfRowGroup,
    /// A page of version 2 declares its number of rows, which in a flat column is its number of values. The library
    /// does not compare them.
    RowsOfPage,
    /// Nulls in a page of a non-nullable column, or more nulls than values. The library does not check.
    NullsOfHeader,
    /// Levels that are longer than their page.
    LengthOfLevels,
    /// A dictionary after a page of values. The library takes the last one.
    DictionaryFirst,
    /// A dictionary with too few bytes for its number of values. The library reads as many values as are asked for.
    DictionarySize,
    /// A page that continues past the end of its column. The library reads the next column's bytes.
    EndOfColumn,
    /// Definition levels other than 0 and 1, runs of levels that end before or after the rows, or levels other than 0
    /// in a non-nullable column. The library takes all but the highest level for null and does not look past the rows.
    Levels,
    /// A run of one key that continues past the last row, or a packed run that does so by a group and is not the last.
    /// The library does not look there.
    Keys,
    /// Truth values with the fault of [`Keys`](Self::Keys); more or fewer bytes than split values take.
    ValuesOfPage,
    /// A page without values in a delta encoding still has the encoding's own header, which declares 0 values. The
    /// library does not read it if it needs no value.
    HeaderOfDelta,
    /// A text with a negative length. The library adds up the lengths unchecked, and accepts the sum if it is within
    /// the page.
    LengthsOfTexts,
    /// A character split between two texts. The library checks all texts of a delta-encoded page at once.
    Texts,
    /// More than a file of its size may hold. The library has no such budget.
    Budget,
    /// Unsigned integers beyond the largest signed 64-bit integer, which metrics cannot represent.
    LargeInteger,
}

/// The depth that a mutant reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Depth {
    /// Refused by its header or its checksum.
    Header,
    /// Refused by the codec, or by the library on the way to the levels.
    Body,
    /// The levels were read and refused.
    Levels,
    /// The values were read and refused.
    Values,
}

/// The program's expectation with `#` for numbers, its reason, and the mutant's depth.
const EXPECTED: [(&str, Reason, Depth); 25] = [
    ("a page header", Reason::HeaderOfOneMeaning, Depth::Header),
    ("a page header that has one meaning", Reason::HeaderOfOneMeaning, Depth::Header),
    ("a size that # bytes can hold", Reason::SizeOfPage, Depth::Header),
    ("at most # values", Reason::RowsOfRowGroup, Depth::Header),
    ("pages of # values", Reason::RowsOfRowGroup, Depth::Header),
    ("# rows", Reason::RowsOfPage, Depth::Header),
    ("no more nulls than there can be", Reason::NullsOfHeader, Depth::Header),
    ("as many nulls as its header says", Reason::NullsOfHeader, Depth::Levels),
    ("levels of at most # bytes", Reason::LengthOfLevels, Depth::Header),
    ("a dictionary before all other pages", Reason::DictionaryFirst, Depth::Header),
    ("keys for # bytes of values", Reason::DictionarySize, Depth::Header),
    ("a page of at most # bytes", Reason::EndOfColumn, Depth::Header),
    ("a page of # bytes", Reason::EndOfColumn, Depth::Header),
    ("a definition level of # or # for each row, and no other level", Reason::Levels, Depth::Levels),
    ("keys within the dictionary, one for each value", Reason::Keys, Depth::Values),
    ("a truth value for each row", Reason::ValuesOfPage, Depth::Values),
    ("a bit for each value", Reason::ValuesOfPage, Depth::Values),
    ("texts as long as their lengths say", Reason::ValuesOfPage, Depth::Values),
    ("as many bytes as its values take", Reason::ValuesOfPage, Depth::Values),
    ("as many values as its levels say", Reason::ValuesOfPage, Depth::Values),
    ("the number of its values", Reason::HeaderOfDelta, Depth::Values),
    ("lengths from #", Reason::LengthsOfTexts, Depth::Values),
    ("at most # bytes inflated from a file of its size", Reason::Budget, Depth::Header),
    ("at most # bytes of texts in the rows of a file of its size", Reason::Budget, Depth::Values),
    ("a number up to #", Reason::LargeInteger, Depth::Values),
];

/// The message about values that the library has decoded, if nothing else was expected.
pub const SPLIT_TEXTS: &str = "texts that are not UTF-8";

/// The reason and depth of a refusal; `None` for an unknown message. Refusals that the library shares have no reason.
pub fn of(expected: &str) -> Option<(Option<Reason>, Depth)> {
    if expected.starts_with("bytes with the CRC-32 ") {
        return Some((None, Depth::Header));
    }
    if expected == "a page that zstd decompresses to its size" {
        return Some((None, Depth::Body));
    }
    let mut words = String::new();
    for char in expected.chars() {
        match char {
            '0'..='9' if words.ends_with('#') => {}
            '0'..='9' => words.push('#'),
            _ => words.push(char),
        }
    }
    EXPECTED.iter().find(|(known, ..)| *known == words).map(|(_, reason, depth)| (Some(*reason), *depth))
}
