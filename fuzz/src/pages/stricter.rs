//! Refusals of pages that the Parquet library would read.
//!
//! Rule: a refusal that the library does not share has one of these reasons, or the target fails.

/// A reason, as what was expected and not found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reason {
    /// The library skips fields of a page header that it does not know, takes one that is there twice, or the header of
    /// another kind of page beside its own. A header with two meanings has none: a checksum does not cover it.
    HeaderOfOneMeaning,
    /// The header says another size than the codec can make of the stored bytes, or of bytes that are not compressed another
    /// one than they have. The library believes it where the decoder does not come to the end.
    SizeOfPage,
    /// Pages of more values than the row group has rows. The library stops reading at the last row.
    RowsOfRowGroup,
    /// A page of version 2 says how many rows it has; in a flat column that is as many as it has values. The library does
    /// not compare them.
    RowsOfPage,
    /// Nulls in a page of a column that has none, or more of them than values. The library does not look.
    NullsOfHeader,
    /// Levels that are longer than their page.
    LengthOfLevels,
    /// A dictionary behind a page of values. The library takes the last one.
    DictionaryFirst,
    /// A dictionary that has fewer bytes than its number of values takes. The library reads as many as it is asked for.
    DictionarySize,
    /// A page that goes on behind the end of its column. The library reads the next column's bytes.
    EndOfColumn,
    /// Definition levels other than 0 and 1, runs of them that end before or behind the rows, levels in a column without
    /// nulls that are not 0. The library takes whatever is not the highest level for null and does not look behind the rows.
    Levels,
    /// A run of one key that goes on behind the last row, or a packed one that does so by a group and is not the last. The
    /// library does not look there.
    Keys,
    /// Truth values as [`Keys`](Self::Keys); more or fewer bytes than split values take.
    ValuesOfPage,
    /// A page of no values in a delta encoding has the encoding's own header, which says that there are none. The library does
    /// not look for it where it needs no value.
    HeaderOfDelta,
    /// Texts of which a length is below 0. The library adds lengths up as they are, and takes what comes of it if it is within
    /// the page.
    LengthsOfTexts,
    /// A character of which one text has the first bytes and the next text the rest. The library looks at all texts of a
    /// delta-encoded page at once.
    Texts,
    /// More than a file of its size may hold: a budget, which the library does not have.
    Budget,
    /// Integers without a sign beyond the largest one of 64 bits with a sign: metrics cannot say them.
    LargeInteger,
}

/// The depth that a mutant reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Depth {
    /// Refused by its header or its checksum.
    Header,
    /// Refused by the codec, or by the library on the way to the levels.
    Body,
    /// The levels were looked at, and refused.
    Levels,
    /// The values were looked at, and refused.
    Values,
}

/// The program's expectation without its numbers, the reason for it, and the depth of the mutant.
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

/// The message about values that the library has decoded, where nothing else is expected.
pub const SPLIT_TEXTS: &str = "texts that are not UTF-8";

/// What a refusal of the program is; `None` for words that are not listed, and no reason for what the library refuses, too.
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
