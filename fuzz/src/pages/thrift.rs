//! Page headers in Thrift's compact protocol, written and read independently of the program's reader.

/// The header of a page, taken apart.
#[derive(Clone, Debug, Default)]
pub struct Header {
    /// 0 data, 1 index, 2 dictionary, 3 data of version 2.
    pub kind: i64,
    /// Bytes when decompressed.
    pub whole: i64,
    /// Bytes as stored.
    pub stored: i64,
    /// CRC-32 of the bytes as stored.
    pub crc: Option<i64>,
    /// The integers of the kind's own header, by field.
    pub own: Vec<(u8, i64)>,
    /// Field 7 of a page of version 2.
    pub is_compressed: Option<bool>,
}

impl Header {
    /// The field of the kind's own header.
    const fn field(&self) -> u8 {
        match self.kind {
            0 => 5,
            1 => 6,
            2 => 7,
            _ => 8,
        }
    }

    /// An integer of the kind's own header.
    pub fn get(&self, field: u8) -> i64 {
        self.own.iter().find(|(known, _)| *known == field).map_or(0, |(_, value)| *value)
    }

    /// Sets an integer of the kind's own header that is there.
    pub fn set(&mut self, field: u8, value: i64) {
        if let Some(place) = self.own.iter_mut().find(|(known, _)| *known == field) {
            place.1 = value;
        }
    }

    /// The header as bytes.
    pub fn bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(32);
        for number in [self.kind, self.whole, self.stored] {
            out.push(0x15);
            varint(&mut out, number);
        }
        let mut last = 3;
        if let Some(crc) = self.crc {
            out.push(0x15);
            varint(&mut out, crc);
            last = 4;
        }
        out.push((self.field() - last) << 4 | 0x0c);
        let mut last = 0;
        for (field, value) in &self.own {
            if self.is_compressed.is_some() && *field > 7 && last < 7 {
                break;
            }
            out.push((field - last) << 4 | 5);
            varint(&mut out, *value);
            last = *field;
        }
        if let Some(is_compressed) = self.is_compressed {
            out.push((7 - last) << 4 | if is_compressed { 1 } else { 2 });
        }
        out.extend([0, 0]);
        out
    }

    /// The header at the start of `data`, and its length; `None` if invalid.
    pub fn read(data: &[u8]) -> Option<(Self, usize)> {
        let mut header = Self::default();
        let (mut at, mut last) = (0, 0);
        loop {
            let (field, wire) = field(data, &mut at, last)?;
            // The library ignores the declared type of these fields and reads an integer.
            match (field, wire) {
                (_, 0) => return Some((header, at)),
                (1, _) => header.kind = read_varint(data, &mut at)?,
                (2, _) => header.whole = read_varint(data, &mut at)?,
                (3, _) => header.stored = read_varint(data, &mut at)?,
                (4, _) => header.crc = Some(read_varint(data, &mut at)?),
                (5..=8, 12) => header.read_own(data, &mut at)?,
                _ => skip(data, &mut at, wire, 0)?,
            }
            last = field;
        }
    }

    /// The checksum that a header declares, whatever follows it: the library goes on where [`Header::read`] gives up.
    pub fn checksum(data: &[u8]) -> Option<i64> {
        let (mut at, mut last) = (0, 0);
        loop {
            let (field, wire) = field(data, &mut at, last)?;
            match (field, wire) {
                (_, 0) | (5.., _) => return None,
                (4, _) => return read_varint(data, &mut at),
                (1..=3, _) => {
                    read_varint(data, &mut at)?;
                }
                _ => skip(data, &mut at, wire, 0)?,
            }
            last = field;
        }
    }

    fn read_own(&mut self, data: &[u8], at: &mut usize) -> Option<()> {
        let mut last = 0;
        loop {
            let (field, wire) = field(data, at, last)?;
            match (field, wire) {
                (_, 0) => return Some(()),
                (field, 5) => self.own.push((u8::try_from(field).ok()?, read_varint(data, at)?)),
                (7, 1 | 2) => self.is_compressed = Some(wire == 1),
                _ => skip(data, at, wire, 0)?,
            }
            last = field;
        }
    }
}

/// The next field: its number and wire type; type 0 ends a structure.
fn field(data: &[u8], at: &mut usize, last: i64) -> Option<(i64, u8)> {
    let byte = *data.get(*at)?;
    *at += 1;
    let wire = byte & 15;
    if wire == 0 {
        return Some((0, 0));
    }
    let field = if byte >> 4 == 0 { read_varint(data, at)? } else { last + i64::from(byte >> 4) };
    Some((field, wire))
}

fn skip(data: &[u8], at: &mut usize, wire: u8, depth: usize) -> Option<()> {
    if depth > 16 {
        return None;
    }
    match wire {
        1 | 2 => {}
        3 => *at += 1,
        4..=6 => drop(read_varint(data, at)?),
        7 => *at += 8,
        8 => {
            let length = usize::try_from(unsigned(data, at)?).ok()?;
            *at = at.checked_add(length)?;
        }
        9 | 10 => {
            let byte = *data.get(*at)?;
            *at += 1;
            let count = if byte >> 4 == 15 { unsigned(data, at)? } else { u64::from(byte >> 4) };
            for _ in 0..count.min(1 << 20) {
                skip(data, at, byte & 15, depth + 1)?;
            }
        }
        12 => {
            let mut last = 0;
            loop {
                let (next, wire) = field(data, at, last)?;
                if wire == 0 {
                    break;
                }
                skip(data, at, wire, depth + 1)?;
                last = next;
            }
        }
        _ => return None,
    }
    (*at <= data.len()).then_some(())
}

fn unsigned(data: &[u8], at: &mut usize) -> Option<u64> {
    let mut value = 0_u64;
    for shift in (0..64).step_by(7) {
        let byte = *data.get(*at)?;
        *at += 1;
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

fn read_varint(data: &[u8], at: &mut usize) -> Option<i64> {
    let value = unsigned(data, at)?;
    Some((value >> 1).cast_signed() ^ -((value & 1).cast_signed()))
}

fn varint(out: &mut Vec<u8>, number: i64) {
    let mut zigzag = ((number << 1) ^ (number >> 63)).cast_unsigned();
    while zigzag >= 0x80 {
        out.push(zigzag.to_le_bytes()[0] | 0x80);
        zigzag >>= 7;
    }
    out.push(zigzag.to_le_bytes()[0]);
}
