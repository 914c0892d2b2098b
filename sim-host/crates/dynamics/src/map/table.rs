//! The map as a Parquet table: the columns of the CSV with their units, and the plan beside them.

use super::arrow_schema::{self, Field, Type as ArrowType};
use super::cell::Cell;
use super::plan::Plan;
use super::tiles::TilesError;
use crate::unit::Unit;
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;
use serde::Serialize;
use std::io::Write;
use std::sync::Arc;

/// Key of the file's metadata under which the plan is, as JSON.
pub const PLAN_KEY: &str = "plan";

/// Key of the CRC-32 of plan and cells as JSON: the format's own pages carry none.
const CHECKSUM_KEY: &str = "crc32";
const CHECKSUM: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Cells of a group of rows: large enough for the compression of columns, small in memory.
const CELLS_A_GROUP: usize = 131_072;

/// A table cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The format's writer failed.
    #[error("the Parquet table cannot be written")]
    Parquet(#[from] ParquetError),
    /// The cells cannot be read.
    #[error(transparent)]
    Tiles(#[from] TilesError),
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

/// Writes the table in groups of rows, of which only one is in memory. Its bytes depend on plan and
/// cells alone.
///
/// # Errors
/// If the writer fails, or a cell is an error.
pub fn write(
    plan: &Plan,
    cells: impl Iterator<Item = Result<Cell, TilesError>>,
    to: impl Write + Send,
) -> Result<(), TableError> {
    let plan = json(plan);
    let no_columns = columns(&[]);
    let fields: Vec<Field> = no_columns.iter().map(Column::arrow_field).collect();
    let units = KeyValue::new(arrow_schema::KEY.into(), arrow_schema::encode(&fields));
    let properties = WriterProperties::builder()
        .set_created_by(concat!("sim-host ", env!("CARGO_PKG_VERSION")).into())
        .set_key_value_metadata(Some(vec![
            KeyValue::new(PLAN_KEY.into(), plan.clone()),
            units,
        ]))
        .build();
    let schema = schema(&no_columns)?;
    let mut file = SerializedFileWriter::new(to, Arc::new(schema), Arc::new(properties))?;
    // Of `[plan,[cell,...]]`.
    let mut checksum = CHECKSUM.digest();
    checksum.update(format!("[{plan},[").as_bytes());
    let mut separator = "";
    let mut group = Vec::new();
    let mut cells = cells.peekable();
    while let Some(cell) = cells.next() {
        let cell = cell?;
        checksum.update(separator.as_bytes());
        checksum.update(json(&cell).as_bytes());
        separator = ",";
        group.push(cell);
        if group.len() == CELLS_A_GROUP || cells.peek().is_none() {
            let mut rows = file.next_row_group()?;
            for column in columns(&group) {
                column.write(&mut rows)?;
            }
            rows.close()?;
            group.clear();
        }
    }
    checksum.update(b"]]");
    let checksum = format!("{:08x}", checksum.finalize());
    file.append_key_value_metadata(KeyValue::new(CHECKSUM_KEY.into(), checksum));
    file.close()?;
    Ok(())
}

fn schema(columns: &[Column]) -> Result<Type, ParquetError> {
    let fields = columns.iter().map(Column::field);
    let fields = fields.collect::<Result<Vec<_>, _>>()?;
    let schema = Type::group_type_builder("map").with_fields(fields);
    schema.build()
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
    fn arrow_field(&self) -> Field {
        let (data_type, nullable) = match self.values {
            Values::Names(_) => (ArrowType::Utf8, false),
            Values::Numbers(_) => (ArrowType::Double, false),
            Values::NumbersOrNone(_) => (ArrowType::Double, true),
            Values::CountsOrNone(_) => (ArrowType::Int32, true),
        };
        Field {
            name: self.name,
            data_type,
            nullable,
            unit: Unit::of(self.name).map(|unit| unit.symbol),
        }
    }

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
        let mut column = rows
            .next_column()?
            .ok_or_else(|| ParquetError::General("a column is missing".into()))?;
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
    use crate::map::cell::Kind;
    use crate::map::plan::{Grid, Sheet, Start};
    use crate::sweep::Timing;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;
    use shared_model::Scenario;
    use shared_model::dither::Waveform;

    fn plan(speeds: usize) -> Plan {
        let grid = |from, to, count| Grid { from, to, count };
        let sheet = Sheet {
            waveform: Waveform::Square,
            start: Start::Given,
            amplitudes_v: grid(0.0, 0.1, 2),
        };
        let speeds_rpm = grid(1000.0, 2000.0, speeds);
        let timing = Timing::new(1.0, 3.0).unwrap();
        Plan::new(Scenario::reconstruction(), vec![sheet], speeds_rpm, timing).unwrap()
    }

    fn cell(number: usize) -> Cell {
        Cell {
            waveform: Waveform::Square,
            start: Start::Given,
            wheel_speed_rpm: number as f64,
            dither_amplitude_v: 0.0,
            kind: Kind::Periodic,
            period: Some(1),
            bands: None,
            exponent_per_s: None,
            exponent_standard_error_per_s: None,
            exponent_threshold_per_s: None,
            yaw_rate_peak_to_peak_rad_per_s: None,
            steering_angle_peak_to_peak_rad: None,
            diverges_at_s: None,
        }
    }

    /// All rows in order, and the check sum of plan and cells as one JSON text.
    #[test]
    fn rows_beyond_a_group_are_in_the_next_one() {
        let cells: Vec<Cell> = (0..CELLS_A_GROUP + 2).map(cell).collect();
        let plan = plan(cells.len() / 2);
        let mut file = tempfile::tempfile().unwrap();
        write(&plan, cells.iter().map(|&cell| Ok(cell)), &mut file).unwrap();
        let table = SerializedFileReader::new(file).unwrap();
        let metadata = table.metadata();
        let rows = |group: usize| metadata.row_group(group).num_rows();
        assert_eq!(metadata.num_row_groups(), 2);
        assert_eq!([rows(0), rows(1)], [CELLS_A_GROUP as i64, 2]);
        let keys = metadata.file_metadata().key_value_metadata().unwrap();
        let checksum = keys.iter().find(|pair| pair.key == CHECKSUM_KEY).unwrap();
        let text = json(&(&plan, &cells));
        let expected = format!("{:08x}", CHECKSUM.checksum(text.as_bytes()));
        assert_eq!(checksum.value.as_ref(), Some(&expected));
        let speeds = table.get_row_iter(None).unwrap();
        let speeds = speeds.map(|row| row.unwrap().get_double(2).unwrap());
        assert!(speeds.eq(cells.iter().map(|cell| cell.wheel_speed_rpm)));
    }
}
