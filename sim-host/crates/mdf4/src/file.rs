//! The file: its identification, the blocks that describe it, and the data of each group.

use crate::block::{Blocks, HEADER_LEN, aligned, block, header};
use crate::channel::{Channel, Encoding, Group, Samples};
use std::io::{self, Write};

/// Length of the identification at the beginning, bytes.
const IDENTIFICATION_LEN: usize = 64;
/// Version of the standard, as text and number.
const VERSION: (&[u8; 8], u16) = (b"4.10    ", 410);
/// `cn_type` of a channel and of the master channel.
const CHANNEL: u8 = 0;
const MASTER: u8 = 2;
/// `cn_sync_type` of a channel and of one that holds the time.
const NO_SYNC: u8 = 0;
const TIME_SYNC: u8 = 1;
/// `cc_type` of a table from values to texts.
const VALUE_TO_TEXT: u8 = 7;
/// Precision is unlimited.
const ANY_PRECISION: u8 = u8::MAX;

/// A measurement file. Its bytes depend on these fields alone: it starts at the time zero, which is
/// 1970, because the time of a simulation is not that of a day.
pub struct File<'a> {
    /// Name of the program that writes it; the first eight bytes are part of the identification.
    pub program: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// Description; may be empty.
    pub comment: String,
    /// The groups.
    pub groups: Vec<Group<'a>>,
}

impl File<'_> {
    /// Writes the file from beginning to end.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write(&self, to: &mut dyn Write) -> io::Result<()> {
        // The addresses of the data follow from the length of what is before, which does not depend
        // on them.
        let mut data_at = self.description(&vec![0; self.groups.len()]).len();
        let mut addresses = Vec::new();
        for group in &self.groups {
            addresses.push(data_at as u64);
            data_at += aligned(HEADER_LEN + group.records * group.record_len());
        }
        to.write_all(&self.description(&addresses))?;
        for group in &self.groups {
            write_data(group, to)?;
        }
        Ok(())
    }

    /// All before the data, which will be at these addresses.
    fn description(&self, data: &[u64]) -> Vec<u8> {
        let header_len = header_block(&[0; 6]).len();
        let mut blocks = Blocks::at(IDENTIFICATION_LEN + header_len);
        let mut next_group = 0;
        for (group, data) in self.groups.iter().zip(data).rev() {
            let channels = channel_group(group, &mut blocks);
            // Records without an identifier: the group has no other.
            next_group = blocks.add(b"DG", &[next_group, channels, *data, 0], &[0; 8]);
        }
        let history = self.history(&mut blocks);
        let comment = blocks.add_text(&self.comment);
        let header = header_block(&[next_group, history, 0, 0, 0, comment]);
        [self.identification(), header, blocks.bytes].concat()
    }

    fn identification(&self) -> Vec<u8> {
        let (version, number) = VERSION;
        let mut program = self.program.as_bytes().to_vec();
        program.resize(8, b' ');
        let mut bytes = [b"MDF     ", version, program.as_slice(), &[0; 4]].concat();
        bytes.extend(number.to_le_bytes());
        bytes.resize(IDENTIFICATION_LEN, 0);
        bytes
    }

    /// The entry of the history that the standard requires: which program wrote the file.
    fn history(&self, blocks: &mut Blocks) -> u64 {
        let comment = blocks.add_xml(&format!(
            "<FHcomment><TX>written</TX><tool_id>{0}</tool_id><tool_vendor>{0}</tool_vendor>\
             <tool_version>{1}</tool_version></FHcomment>",
            escaped(self.program),
            escaped(self.version)
        ));
        // Time zero, in UTC.
        blocks.add(b"FH", &[0, comment], &[0; 16])
    }
}

/// The block at a fixed address: start at the time zero, in UTC; no angle or distance.
fn header_block(links: &[u64; 6]) -> Vec<u8> {
    block(b"HD", links, &[0; 32])
}

/// Appends a group with its channels, and returns its address.
fn channel_group(group: &Group, blocks: &mut Blocks) -> u64 {
    let mut next = 0;
    let mut end = group.record_len();
    for channel in group.channels.iter().rev() {
        end -= channel.samples.len();
        next = add_channel(channel, (CHANNEL, NO_SYNC), end, next, blocks);
    }
    let time = Channel {
        name: "time_s".into(),
        unit: "s",
        comment: "Time.".into(),
        samples: Samples::F64(Box::new(|_| 0.0)),
    };
    let first = add_channel(&time, (MASTER, TIME_SYNC), 0, next, blocks);
    let name = blocks.add_text(&group.name);
    let mut data = vec![0; 8];
    data.extend((group.records as u64).to_le_bytes());
    // Flags, path separator, reserved.
    data.extend([0; 8]);
    data.extend((group.record_len() as u32).to_le_bytes());
    // No invalidation bits.
    data.extend([0; 4]);
    blocks.add(b"CG", &[0, first, name, 0, 0, 0], &data)
}

/// Appends a channel whose sample is at that byte of a record, and returns its address.
fn add_channel(
    channel: &Channel,
    (kind, sync): (u8, u8),
    at: usize,
    next: u64,
    blocks: &mut Blocks,
) -> u64 {
    let Channel { samples, .. } = channel;
    let name = blocks.add_text(&channel.name);
    let conversion = add_names(samples, blocks);
    let unit = blocks.add_text(channel.unit);
    let comment = blocks.add_text(&channel.comment);
    let encoding: Encoding = samples.encoding();
    let mut data = vec![kind, sync, encoding as u8, 0];
    data.extend((at as u32).to_le_bytes());
    data.extend((8 * samples.len() as u32).to_le_bytes());
    // Flags and the position of an invalidation bit.
    data.extend([0; 8]);
    data.extend([ANY_PRECISION, 0, 0, 0]);
    // Ranges and limits, which are not valid without their flags.
    data.extend([0; 48]);
    let links = [next, 0, name, 0, conversion, 0, unit, comment];
    blocks.add(b"CN", &links, &data)
}

/// Appends the table of the names of codes, and returns its address; 0 for numbers.
fn add_names(samples: &Samples, blocks: &mut Blocks) -> u64 {
    let Samples::Name(_, names) = samples else {
        return 0;
    };
    let mut links = vec![0; 4];
    links.extend(names.iter().map(|(_, name)| blocks.add_text(name)));
    // No name for another code.
    links.push(0);
    let mut data = vec![VALUE_TO_TEXT, ANY_PRECISION, 0, 0];
    data.extend((names.len() as u16 + 1).to_le_bytes());
    data.extend((names.len() as u16).to_le_bytes());
    // No range of the values.
    data.extend([0; 16]);
    data.extend(
        names
            .iter()
            .flat_map(|(code, _)| f64::from(*code).to_le_bytes()),
    );
    blocks.add(b"CC", &links, &data)
}

/// Writes the records of a group.
fn write_data(group: &Group, to: &mut dyn Write) -> io::Result<()> {
    let length = group.records * group.record_len();
    to.write_all(&header(b"DT", 0, length))?;
    let mut bytes = Vec::new();
    for record in 0..group.records {
        bytes.clear();
        bytes.extend((group.time_s)(record).to_le_bytes());
        for channel in &group.channels {
            channel.samples.append(record, &mut bytes);
        }
        to.write_all(&bytes)?;
    }
    let padding = aligned(HEADER_LEN + length) - HEADER_LEN - length;
    to.write_all(&[0; 8][..padding])
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}
