//! Blocks: a header with type, length and number of links, then the links, then the data.

/// Length of a block's header, bytes.
pub(crate) const HEADER_LEN: usize = 24;
/// Blocks begin at multiples of this address.
const ALIGNMENT: usize = 8;

/// A block.
pub(crate) fn block(kind: &[u8; 2], links: &[u64], data: &[u8]) -> Vec<u8> {
    let mut bytes = header(kind, links.len(), data.len());
    bytes.extend(links.iter().flat_map(|link| link.to_le_bytes()));
    bytes.extend(data);
    bytes.resize(aligned(bytes.len()), 0);
    bytes
}

/// The header of a block with data of that length.
pub(crate) fn header(kind: &[u8; 2], links: usize, data_len: usize) -> Vec<u8> {
    let length = HEADER_LEN + 8 * links + data_len;
    let mut bytes = [b"##", kind.as_slice(), &[0; 4]].concat();
    bytes.extend((length as u64).to_le_bytes());
    bytes.extend((links as u64).to_le_bytes());
    bytes
}

/// The length with the padding up to the next block.
pub(crate) fn aligned(length: usize) -> usize {
    length.next_multiple_of(ALIGNMENT)
}

/// Blocks in the order of the file, each after those that it links.
pub(crate) struct Blocks {
    start: usize,
    pub(crate) bytes: Vec<u8>,
}

impl Blocks {
    /// The first one is to be at the address `start`.
    pub(crate) fn at(start: usize) -> Self {
        let bytes = Vec::new();
        Self { start, bytes }
    }

    /// Appends a block and returns its address.
    pub(crate) fn add(&mut self, kind: &[u8; 2], links: &[u64], data: &[u8]) -> u64 {
        let address = self.start + self.bytes.len();
        self.bytes.extend(block(kind, links, data));
        address as u64
    }

    /// Appends a text and returns its address, 0 for an empty one.
    pub(crate) fn add_text(&mut self, text: &str) -> u64 {
        match text {
            "" => 0,
            _ => self.add(b"TX", &[], &terminated(text)),
        }
    }

    /// Appends an XML text and returns its address.
    pub(crate) fn add_xml(&mut self, xml: &str) -> u64 {
        self.add(b"MD", &[], &terminated(xml))
    }
}

/// The text with the zero that ends it, and no other.
fn terminated(text: &str) -> Vec<u8> {
    let mut bytes = text.replace('\0', " ").into_bytes();
    bytes.push(0);
    bytes
}
