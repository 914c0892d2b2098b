//! Channels and their samples.

/// Number of the record in, its sample out.
pub type SampleOf<'a, T> = Box<dyn Fn(usize) -> T + 'a>;

/// Samples of a channel, stored in the type that they have.
pub enum Samples<'a> {
    /// Numbers in double precision.
    F64(SampleOf<'a, f64>),
    /// Numbers in single precision.
    F32(SampleOf<'a, f32>),
    /// Integers of 32 bits, without sign.
    U32(SampleOf<'a, u32>),
    /// Integers of 16 bits, without sign.
    U16(SampleOf<'a, u16>),
    /// Integers of 8 bits, without sign.
    U8(SampleOf<'a, u8>),
    /// Names by their codes, with a list of all codes.
    Name(SampleOf<'a, u8>, Vec<(u8, String)>),
}

/// Interpretation of the bits of a sample (`cn_data_type`).
#[derive(Clone, Copy)]
pub(crate) enum Encoding {
    /// Integer without sign, little-endian.
    Unsigned = 0,
    /// IEEE 754, little-endian.
    Float = 4,
}

impl Samples<'_> {
    /// Length of a sample, bytes.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::F64(_) => 8,
            Self::F32(_) | Self::U32(_) => 4,
            Self::U16(_) => 2,
            Self::U8(_) | Self::Name(..) => 1,
        }
    }

    pub(crate) fn encoding(&self) -> Encoding {
        match self {
            Self::F64(_) | Self::F32(_) => Encoding::Float,
            Self::U32(_) | Self::U16(_) | Self::U8(_) | Self::Name(..) => Encoding::Unsigned,
        }
    }

    /// Appends the sample of a record.
    pub(crate) fn append(&self, record: usize, to: &mut Vec<u8>) {
        match self {
            Self::F64(of) => to.extend(of(record).to_le_bytes()),
            Self::F32(of) => to.extend(of(record).to_le_bytes()),
            Self::U32(of) => to.extend(of(record).to_le_bytes()),
            Self::U16(of) => to.extend(of(record).to_le_bytes()),
            Self::U8(of) | Self::Name(of, _) => to.push(of(record)),
        }
    }
}

/// A channel.
pub struct Channel<'a> {
    /// Name, unique in the file.
    pub name: String,
    /// Symbol of the unit; empty without one.
    pub unit: &'static str,
    /// Description; may be empty.
    pub comment: String,
    /// One sample per record.
    pub samples: Samples<'a>,
}

/// Channels that are sampled at the same times.
pub struct Group<'a> {
    /// Name.
    pub name: String,
    /// Number of records.
    pub records: usize,
    /// Time of a record, s; it increases. It is the master channel, with the name `time_s`.
    pub time_s: SampleOf<'a, f64>,
    /// The other channels.
    pub channels: Vec<Channel<'a>>,
}

impl Group<'_> {
    /// Length of a record, bytes.
    pub(crate) fn record_len(&self) -> usize {
        let channels = self.channels.iter();
        size_of::<f64>() + channels.map(|channel| channel.samples.len()).sum::<usize>()
    }
}
