//! Writing Parquet: a column of doubles each, what was not sampled null; units and meanings in the file's metadata.

use std::io::{self, Write};
use std::sync::Arc;

use parquet::basic::{Compression, Repetition, Type as Physical, ZstdLevel};
use parquet::data_type::DoubleType;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use crate::{columns, units};

/// Rows that are put together before they are written, the format's unit of compression and of skipping.
const GROUP_ROWS: usize = 1 << 16;

/// Writes rows, by groups of columns. A file without its end cannot be read by anybody: a recording under way is MCAP.
pub(super) struct Rows<W: Write + Send> {
    writer: SerializedFileWriter<W>,
    time_s: Vec<f64>,
    /// Of each column the values, and for each row whether it has one.
    columns: Vec<(Vec<f64>, Vec<i16>)>,
}

impl<W: Write + Send> Rows<W> {
    pub(super) fn create(names: &[&str], output: W) -> io::Result<Self> {
        let field = |name: &str, kind: Repetition| {
            Type::primitive_type_builder(name, Physical::DOUBLE).with_repetition(kind).build().map(Arc::new)
        };
        let mut fields = vec![field("time_s", Repetition::REQUIRED).map_err(cause)?];
        for name in names {
            fields.push(field(name, Repetition::OPTIONAL).map_err(cause)?);
        }
        let schema = Type::group_type_builder("recording").with_fields(fields).build().map_err(cause)?;
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_created_by(format!("kort {}", env!("CARGO_PKG_VERSION")))
            .set_key_value_metadata(Some(vec![KeyValue::new("kort.columns".to_owned(), about(names))]))
            .build();
        let writer =
            SerializedFileWriter::new(output, Arc::new(schema), Arc::new(properties)).map_err(cause)?;
        Ok(Self { writer, time_s: Vec::new(), columns: vec![(Vec::new(), Vec::new()); names.len()] })
    }

    pub(super) fn row(&mut self, time_s: f64, values: &[f64]) -> io::Result<()> {
        self.time_s.push(time_s);
        for ((kept, has), value) in self.columns.iter_mut().zip(values) {
            if !value.is_nan() {
                kept.push(*value);
            }
            has.push(i16::from(!value.is_nan()));
        }
        if self.time_s.len() >= GROUP_ROWS { self.group() } else { Ok(()) }
    }

    fn group(&mut self) -> io::Result<()> {
        let mut group = self.writer.next_row_group().map_err(cause)?;
        let time = (std::mem::take(&mut self.time_s), Vec::new());
        for (values, has) in std::iter::once(&time).chain(&self.columns) {
            let Some(mut column) = group.next_column().map_err(cause)? else { break };
            let has = (!has.is_empty()).then_some(has.as_slice());
            column.typed::<DoubleType>().write_batch(values, has, None).map_err(cause)?;
            column.close().map_err(cause)?;
        }
        group.close().map_err(cause)?;
        for (values, has) in &mut self.columns {
            values.clear();
            has.clear();
        }
        Ok(())
    }

    /// Ends the file: without this there is none.
    pub(super) fn finish(mut self) -> io::Result<()> {
        if !self.time_s.is_empty() {
            self.group()?;
        }
        self.writer.into_inner().map_err(cause)?.flush()
    }
}

/// Unit and meaning of each column, JSON by its name.
fn about(names: &[&str]) -> String {
    let of = |name: &str| match columns::find(name) {
        Some(known) => serde_json::json!({"unit": known.unit, "meaning": known.meaning}),
        None => serde_json::json!({"unit": units::of_column(name).map_or("1", |unit| unit.symbol)}),
    };
    let all = std::iter::once(&"time_s").chain(names).map(|name| ((*name).to_owned(), of(name)));
    serde_json::Value::Object(all.collect()).to_string()
}

fn cause(error: ParquetError) -> io::Error {
    io::Error::other(error)
}

#[cfg(test)]
mod tests {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    use super::*;

    #[test]
    fn rows_come_back_with_what_was_not_sampled_as_null() {
        let mut bytes = Vec::new();
        let mut rows = Rows::create(&["thrust_n", "my_column_bar"], &mut bytes).unwrap();
        let many = GROUP_ROWS + 3;
        for k in 0..many {
            let thrust_n = if k % 3 == 0 { f64::NAN } else { k as f64 };
            rows.row(0.01 * k as f64, &[thrust_n, f64::NAN]).unwrap();
        }
        rows.finish().unwrap();
        let file = SerializedFileReader::new(bytes::Bytes::from(bytes)).unwrap();
        assert_eq!(file.num_row_groups(), 2);
        let about = file.metadata().file_metadata().key_value_metadata().unwrap()[0].value.clone().unwrap();
        let about: serde_json::Value = serde_json::from_str(&about).unwrap();
        assert_eq!(
            (&about["thrust_n"]["unit"], &about["my_column_bar"]["unit"]),
            (&"N".into(), &"bar".into())
        );
        let mut read = 0;
        for (k, row) in file.get_row_iter(None).unwrap().enumerate() {
            let cells: Vec<Field> = row.unwrap().get_column_iter().map(|(_, cell)| cell.clone()).collect();
            let thrust = if k % 3 == 0 { Field::Null } else { Field::Double(k as f64) };
            assert_eq!(cells, [Field::Double(0.01 * k as f64), thrust, Field::Null]);
            read += 1;
        }
        assert_eq!(read, many);
    }
}
