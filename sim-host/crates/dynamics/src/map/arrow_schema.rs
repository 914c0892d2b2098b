//! The Arrow schema of a Parquet file, which holds the units of the columns: Parquet has no place for
//! the metadata of a column, and readers take them from here.
//!
//! It is the message `Schema` of Arrow's IPC format, a FlatBuffer of the tables in `Message.fbs` and
//! `Schema.fbs` of that format, as base64.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flatbuffers::{FlatBufferBuilder, TableFinishedWIPOffset, VOffsetT, WIPOffset};

/// Key of the file's metadata under which readers expect it.
pub const KEY: &str = "ARROW:schema";
/// Key of a column's metadata under which its unit is.
const UNIT_KEY: &str = "unit";

/// `MetadataVersion.V5`, `MessageHeader.Schema`.
const VERSION: i16 = 4;
const SCHEMA: u8 = 1;
/// `Precision.DOUBLE`.
const DOUBLE: i16 = 2;
/// Begins a message.
const CONTINUATION: [u8; 4] = [0xFF; 4];
/// Messages have a length that is a multiple of this.
const ALIGNMENT: usize = 8;

/// Type of a column: its number in the union `Type`.
#[derive(Clone, Copy)]
pub enum Type {
    /// Integers of 32 bits with sign.
    Int32 = 2,
    /// Numbers in double precision.
    Double = 3,
    /// Texts.
    Utf8 = 5,
}

/// A column.
pub struct Field {
    /// Name.
    pub name: &'static str,
    /// Type.
    pub data_type: Type,
    /// Whether a value may be missing.
    pub nullable: bool,
    /// Symbol of the unit, if it has one.
    pub unit: Option<&'static str>,
}

type Builder = FlatBufferBuilder<'static>;
type Table = WIPOffset<TableFinishedWIPOffset>;

/// Place of a table's member with that number, from 0 on.
const fn member(number: u16) -> VOffsetT {
    4 + 2 * number
}

/// The schema as the value of its key.
pub fn encode(fields: &[Field]) -> String {
    let mut builder = Builder::new();
    let fields: Vec<Table> = fields
        .iter()
        .map(|field| add_field(&mut builder, field))
        .collect();
    let fields = builder.create_vector(&fields);
    let start = builder.start_table();
    builder.push_slot_always(member(1), fields);
    let schema = builder.end_table(start);

    let start = builder.start_table();
    builder.push_slot_always(member(0), VERSION);
    builder.push_slot_always(member(1), SCHEMA);
    builder.push_slot_always(member(2), schema);
    let message = builder.end_table(start);
    builder.finish_minimal(message);

    let mut message = builder.finished_data().to_vec();
    message.resize(message.len().next_multiple_of(ALIGNMENT), 0);
    let length = (message.len() as u32).to_le_bytes();
    STANDARD.encode([&CONTINUATION, &length, message.as_slice()].concat())
}

fn add_field(builder: &mut Builder, field: &Field) -> Table {
    let name = builder.create_string(field.name);
    let data_type = add_type(builder, field.data_type);
    let children = builder.create_vector::<Table>(&[]);
    let units: Vec<Table> = field
        .unit
        .map(|unit| add_pair(builder, UNIT_KEY, unit))
        .into_iter()
        .collect();
    let metadata = builder.create_vector(&units);
    let start = builder.start_table();
    builder.push_slot_always(member(0), name);
    builder.push_slot_always(member(1), field.nullable);
    builder.push_slot_always(member(2), field.data_type as u8);
    builder.push_slot_always(member(3), data_type);
    builder.push_slot_always(member(5), children);
    builder.push_slot_always(member(6), metadata);
    builder.end_table(start)
}

fn add_type(builder: &mut Builder, data_type: Type) -> Table {
    let start = builder.start_table();
    match data_type {
        Type::Int32 => {
            builder.push_slot_always(member(0), 32_i32);
            builder.push_slot_always(member(1), true);
        }
        Type::Double => builder.push_slot_always(member(0), DOUBLE),
        Type::Utf8 => {}
    }
    builder.end_table(start)
}

fn add_pair(builder: &mut Builder, key: &str, value: &str) -> Table {
    let key = builder.create_string(key);
    let value = builder.create_string(value);
    let start = builder.start_table();
    builder.push_slot_always(member(0), key);
    builder.push_slot_always(member(1), value);
    builder.end_table(start)
}
