//! The map as a Parquet table: the columns of the CSV, and the plan beside them. Written, and read
//! back.

use super::cell::{Cell, InvalidCell};
use super::plan::{Plan, PlanError};
use bytes::Bytes;
use files::input;
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::column::page::Page;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::{FileMetaData, KeyValue};
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::record::{Field, Row};
use parquet::schema::types::Type;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

/// Key of the file's metadata under which the plan is, as JSON.
pub const PLAN_KEY: &str = "plan";

/// Most rows that a byte of a file can hold: neighbours differ in at least one number, which takes
/// a bit.
const MOST_ROWS_A_BYTE: usize = 8;
/// First bytes of a Parquet file.
const MAGIC: &[u8] = b"PAR1";
/// Longest file, bytes: the most cells that a map can have, each number as it is.
const MOST_BYTES: u64 = 2 << 30;

/// Key of the CRC-32 of plan and cells as JSON: the format's own pages carry none.
const CHECKSUM_KEY: &str = "crc32";
const CHECKSUM: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// A file is no table of a map, or a table cannot be written.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each message is its description")]
pub enum TableError {
    #[error(transparent)]
    Io(#[from] std::io::Error),
    #[error("it is no Parquet file, or not a whole one")]
    NotParquet(#[source] ParquetError),
    #[error(transparent)]
    Parquet(#[from] ParquetError),
    #[error("it is damaged")]
    Damaged,
    #[error("it is damaged: a page of {bytes} bytes cannot have {values} values")]
    Page { bytes: usize, values: u32 },
    #[error("it is damaged: its cells are not those that were written")]
    Checksum,
    #[error("its rows are not the cells of its plan")]
    Rows,
    #[error("its columns are not those of a map")]
    Columns,
    #[error("it has no plan of a map in its metadata")]
    NoPlan,
    #[error("its plan cannot be read")]
    Plan(#[source] serde_json::Error),
    #[error("version {found} of the program made it, and this is {own}", own = env!("CARGO_PKG_VERSION"))]
    Version { found: String },
    #[error("its plan is none")]
    InvalidPlan(#[from] PlanError),
    #[error("{column} is {value}, which no column of a map holds")]
    Field { column: String, value: String },
    #[error("a row is no cell of a map")]
    Cell(#[source] serde_json::Error),
    #[error("a row is no cell of a map")]
    InvalidCell(#[from] InvalidCell),
}

fn checksum(plan: &Plan, cells: &[Cell]) -> String {
    let sum = CHECKSUM.checksum(json(&(plan, cells)).as_bytes());
    format!("{sum:08x}")
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("plans and cells are plain data")
}

/// A column: its name, and the values of the cells.
struct Column {
    name: &'static str,
    values: Values,
}

/// Values of a column; one that a cell may lack is none there.
enum Values {
    Names(Vec<ByteArray>),
    Numbers(Vec<f64>),
    NumbersOrNone(Vec<Option<f64>>),
    CountsOrNone(Vec<Option<u32>>),
}

/// Writes the table. Its bytes depend on plan and cells alone.
///
/// # Errors
/// If the writer fails.
pub fn write(plan: &Plan, cells: &[Cell], to: impl Write + Send) -> Result<(), TableError> {
    let columns = columns(cells);
    let schema = schema(&columns)?;
    let checksum = KeyValue::new(CHECKSUM_KEY.into(), checksum(plan, cells));
    let plan = KeyValue::new(PLAN_KEY.into(), json(plan));
    let properties = WriterProperties::builder()
        .set_created_by(concat!("sim-host ", env!("CARGO_PKG_VERSION")).into())
        .set_key_value_metadata(Some(vec![plan, checksum]))
        .build();
    let mut file = SerializedFileWriter::new(to, Arc::new(schema), Arc::new(properties))?;
    let mut rows = file.next_row_group()?;
    for column in &columns {
        column.write(&mut rows)?;
    }
    rows.close()?;
    file.close()?;
    Ok(())
}

/// Reads plan and cells of a file, the cells in the plan's order.
///
/// # Errors
/// If it is no table that this version of the program has written, or a damaged one.
pub fn open(path: &Path) -> Result<(Plan, Vec<Cell>), TableError> {
    let is_start = |start: &[u8]| start.starts_with(MAGIC);
    read(input::read(path, MOST_BYTES, is_start)?)
}

/// Reads plan and cells of a table, the cells in the plan's order.
///
/// # Errors
/// As [`open`].
pub fn read(table: Vec<u8>) -> Result<(Plan, Vec<Cell>), TableError> {
    // Some damage makes the crate panic.
    let table = std::panic::catch_unwind(|| read_whole(table.into()));
    table.unwrap_or(Err(TableError::Damaged))
}

fn read_whole(bytes: Bytes) -> Result<(Plan, Vec<Cell>), TableError> {
    let length = bytes.len();
    let table = SerializedFileReader::new(bytes).map_err(TableError::NotParquet)?;
    let metadata = table.metadata().file_metadata();
    let plan = plan(metadata)?;
    // A few bytes may claim to be any number of rows, so they are counted against plan and file
    // before memory is taken.
    if metadata.num_rows() != plan.cells() as i64
        || plan.cells() > MOST_ROWS_A_BYTE.saturating_mul(length)
    {
        return Err(TableError::Rows);
    }
    if *metadata.schema() != schema(&columns(&[]))? || table.num_row_groups() != 1 {
        return Err(TableError::Columns);
    }
    check_pages(&*table.get_row_group(0)?, plan.cells())?;
    let mut cells = Vec::with_capacity(plan.cells());
    let mut places = (0..plan.tiles()).flat_map(|tile| plan.places(tile));
    for row in table.get_row_iter(None)? {
        let cell = cell(&row?)?;
        if places.next() != Some(cell.place()) {
            return Err(TableError::Rows);
        }
        cells.push(cell);
    }
    if places.next().is_some() {
        return Err(TableError::Rows);
    }
    if noted(metadata, CHECKSUM_KEY) != Some(&checksum(&plan, &cells)) {
        return Err(TableError::Checksum);
    }
    Ok((plan, cells))
}

/// The crate takes memory for as many values as a page says that it has.
fn check_pages(rows: &dyn RowGroupReader, cells: usize) -> Result<(), TableError> {
    for column in 0..rows.num_columns() {
        let mut pages = rows.get_column_page_reader(column)?;
        while let Some(page) = pages.get_next_page()? {
            let most = match page {
                Page::DictionaryPage { .. } => page.buffer().len(),
                Page::DataPage { .. } | Page::DataPageV2 { .. } => cells,
            };
            let (bytes, values) = (page.buffer().len(), page.num_values());
            if values as usize > most {
                return Err(TableError::Page { bytes, values });
            }
        }
    }
    Ok(())
}

fn schema(columns: &[Column]) -> Result<Type, ParquetError> {
    let fields = columns.iter().map(Column::field);
    let fields = fields.collect::<Result<Vec<_>, _>>()?;
    let schema = Type::group_type_builder("map").with_fields(fields);
    schema.build()
}

/// The one key of a plan that all versions of the program have.
#[derive(Deserialize)]
struct MadeBy {
    version: String,
}

fn noted<'a>(metadata: &'a FileMetaData, key: &str) -> Option<&'a str> {
    let mut pairs = metadata.key_value_metadata().into_iter().flatten();
    pairs.find(|pair| pair.key == key)?.value.as_deref()
}

fn plan(metadata: &FileMetaData) -> Result<Plan, TableError> {
    let json = noted(metadata, PLAN_KEY).ok_or(TableError::NoPlan)?;
    let MadeBy { version } = serde_json::from_str(json).map_err(TableError::Plan)?;
    if version != env!("CARGO_PKG_VERSION") {
        return Err(TableError::Version { found: version });
    }
    let plan: Plan = serde_json::from_str(json).map_err(TableError::Plan)?;
    plan.validate()?;
    Ok(plan)
}

/// A row as a cell, by the names of its columns.
fn cell(row: &Row) -> Result<Cell, TableError> {
    let named = |(name, field): (&String, &Field)| {
        let value = match field {
            Field::Null => Value::Null,
            Field::Str(name) => name.as_str().into(),
            Field::Int(count) => (*count).into(),
            Field::Double(number) => (*number).into(),
            other => {
                return Err(TableError::Field {
                    column: name.clone(),
                    value: other.to_string(),
                });
            }
        };
        Ok((name.clone(), value))
    };
    let fields = row.get_column_iter().map(named);
    let fields = Value::Object(fields.collect::<Result<_, _>>()?);
    let cell: Cell = serde_json::from_value(fields).map_err(TableError::Cell)?;
    cell.validate()?;
    Ok(cell)
}

fn columns(cells: &[Cell]) -> Vec<Column> {
    let numbers = |name, of: fn(&Cell) -> f64| Column {
        name,
        values: Values::Numbers(cells.iter().map(of).collect()),
    };
    let numbers_or_none = |name, of: fn(&Cell) -> Option<f64>| Column {
        name,
        values: Values::NumbersOrNone(cells.iter().map(of).collect()),
    };
    let counts_or_none = |name, of: fn(&Cell) -> Option<u32>| Column {
        name,
        values: Values::CountsOrNone(cells.iter().map(of).collect()),
    };
    vec![
        names("waveform", cells, |cell| cell.waveform),
        names("start", cells, |cell| cell.start),
        numbers("wheel_speed_rpm", |cell| cell.wheel_speed_rpm),
        numbers("dither_amplitude_v", |cell| cell.dither_amplitude_v),
        names("kind", cells, |cell| cell.kind),
        counts_or_none("period", |cell| cell.period),
        counts_or_none("bands", |cell| cell.bands),
        numbers_or_none("exponent_per_s", |cell| cell.exponent_per_s),
        numbers_or_none("exponent_standard_error_per_s", |cell| {
            cell.exponent_standard_error_per_s
        }),
        numbers_or_none("exponent_threshold_per_s", |cell| {
            cell.exponent_threshold_per_s
        }),
        numbers_or_none("yaw_rate_peak_to_peak_rad_per_s", |cell| {
            cell.yaw_rate_peak_to_peak_rad_per_s
        }),
        numbers_or_none("steering_angle_peak_to_peak_rad", |cell| {
            cell.steering_angle_peak_to_peak_rad
        }),
        numbers_or_none("diverges_at_s", |cell| cell.diverges_at_s),
    ]
}

/// A column of names, as the CSV has them.
fn names<T: Serialize>(name: &'static str, cells: &[Cell], of: fn(&Cell) -> T) -> Column {
    // A name of JSON without its quotes.
    let text = |cell| json(&of(cell)).trim_matches('"').to_owned();
    let names = cells.iter().map(|cell| text(cell).into_bytes().into());
    Column {
        name,
        values: Values::Names(names.collect()),
    }
}

impl Column {
    fn field(&self) -> parquet::errors::Result<Arc<Type>> {
        let (physical, logical, repetition) = match self.values {
            Values::Names(_) => (
                Physical::BYTE_ARRAY,
                Some(LogicalType::String),
                Repetition::REQUIRED,
            ),
            Values::Numbers(_) => (Physical::DOUBLE, None, Repetition::REQUIRED),
            Values::NumbersOrNone(_) => (Physical::DOUBLE, None, Repetition::OPTIONAL),
            Values::CountsOrNone(_) => (Physical::INT32, None, Repetition::OPTIONAL),
        };
        let field = Type::primitive_type_builder(self.name, physical)
            .with_logical_type(logical)
            .with_repetition(repetition);
        Ok(Arc::new(field.build()?))
    }

    fn write<W: Write + Send>(
        &self,
        rows: &mut SerializedRowGroupWriter<W>,
    ) -> Result<(), TableError> {
        let mut column = rows.next_column()?.ok_or(TableError::Columns)?;
        match &self.values {
            Values::Names(names) => {
                column
                    .typed::<ByteArrayType>()
                    .write_batch(names, None, None)?;
            }
            Values::Numbers(numbers) => {
                column
                    .typed::<DoubleType>()
                    .write_batch(numbers, None, None)?;
            }
            Values::NumbersOrNone(numbers) => {
                let there: Vec<f64> = numbers.iter().copied().flatten().collect();
                let levels = levels(numbers);
                column
                    .typed::<DoubleType>()
                    .write_batch(&there, Some(&levels), None)?;
            }
            Values::CountsOrNone(counts) => {
                let there: Vec<i32> = counts.iter().flatten().map(|&n| n as i32).collect();
                let levels = levels(counts);
                column
                    .typed::<Int32Type>()
                    .write_batch(&there, Some(&levels), None)?;
            }
        }
        column.close()?;
        Ok(())
    }
}

/// Which values are there: 1, else 0.
fn levels<T>(values: &[Option<T>]) -> Vec<i16> {
    values
        .iter()
        .map(|value| i16::from(value.is_some()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::cell::{Kind, cells};
    use crate::map::plan::{Grid, Sheet, Start};
    use crate::sweep::Timing;
    use shared_model::Scenario;
    use shared_model::dither::Waveform;

    /// A map with cells of each kind.
    fn map() -> (Plan, Vec<Cell>) {
        let grid = |from, to| Grid { from, to, count: 3 };
        let sheet = |start| Sheet {
            waveform: Waveform::Square,
            start,
            amplitudes_v: grid(0.0, 0.1),
        };
        let sheets = vec![sheet(Start::Given), sheet(Start::Mirrored)];
        let timing = Timing::new(1.0, 3.0).unwrap();
        let speeds = grid(1600.0, 1700.1);
        let plan = Plan::new(Scenario::reconstruction(), sheets, speeds, timing).unwrap();
        let mut cells = cells(&plan, &plan.places(0)).unwrap();
        let kinds = [
            (Kind::Equilibrium, Some(0), None),
            (Kind::Periodic, Some(16), None),
            (Kind::Chaos, None, Some(2)),
            (Kind::Undecided, Some(1), None),
            (Kind::Diverges, None, None),
        ];
        for (cell, (kind, period, bands)) in cells.iter_mut().zip(kinds) {
            (cell.kind, cell.period, cell.bands) = (kind, period, bands);
        }
        cells[0].exponent_per_s = None;
        cells[4].diverges_at_s = Some(0.1 + 0.2);
        (plan, cells)
    }

    fn written(plan: &Plan, cells: &[Cell]) -> Vec<u8> {
        let mut bytes = Vec::new();
        write(plan, cells, &mut bytes).unwrap();
        bytes
    }

    fn read_back(bytes: &[u8]) -> Result<(Plan, Vec<Cell>), TableError> {
        read(bytes.to_vec())
    }

    fn assert_refused(bytes: &[u8], part: &str) {
        let error = read_back(bytes).unwrap_err();
        let source = std::error::Error::source(&error);
        let refusal = format!(
            "{error}: {}",
            source.map_or(String::new(), ToString::to_string)
        );
        assert!(refusal.contains(part), "{refusal} lacks {part:?}");
    }

    #[test]
    fn what_is_written_is_read() {
        let (plan, cells) = map();
        let read = read_back(&written(&plan, &cells)).unwrap();
        assert_eq!(read, (plan, cells));
    }

    /// Whatever bit flips, the file is refused or nothing has changed.
    #[test]
    fn no_damage_goes_unnoticed() {
        let (plan, cells) = map();
        let whole = written(&plan, &cells);
        let mut refused = 0;
        for bit in (0..8 * whole.len()).step_by(37) {
            let mut damaged = whole.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            match read_back(&damaged) {
                Ok(found) => assert_eq!(found, (plan.clone(), cells.clone()), "bit {bit}"),
                Err(_) => refused += 1,
            }
        }
        assert!(refused > 100, "{refused}");
    }

    #[test]
    fn what_is_no_map_is_refused() {
        let (mut plan, mut cells) = map();
        let whole = written(&plan, &cells);
        for length in [0, 3, 100, whole.len() - 1] {
            assert_refused(&whole[..length], "not a whole one");
        }
        let mut other_key = whole.clone();
        let is_key = |bytes: &[u8]| bytes == b"\x04plan";
        let key = other_key.windows(5).rposition(is_key).unwrap();
        other_key[key + 1..key + 5].copy_from_slice(b"nalp");
        assert_refused(&other_key, "no plan of a map");
        let few = written(&plan, &cells[1..]);
        assert_refused(&few, "not the cells of its plan");
        cells.swap(0, 1);
        let swapped = written(&plan, &cells);
        assert_refused(&swapped, "not the cells of its plan");
        plan.sheets[1].amplitudes_v.count = 4;
        assert_refused(&written(&plan, &cells), "as many amplitudes");
        plan.version = "0.0.1".into();
        assert_refused(&written(&plan, &cells), "version 0.0.1 of the program");
    }
}
