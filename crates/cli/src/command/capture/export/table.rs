//! Tables of datagrams as files of other programs.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use linesman_capture::record::DatagramRecord;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::record::RecordWriter as _;

use crate::failure::Failure;
use crate::version;

/// Rows that are written at once: a group of rows of a Parquet file, which is kept in memory until it is full.
const GROUP_ROWS: usize = 100_000;

/// A table in a file.
pub(super) struct DatagramTable {
    path: PathBuf,
    rows: u64,
    form: TableForm,
}

/// The file that a table goes to.
enum TableForm {
    Csv(Box<csv::Writer<File>>),
    Parquet { writer: Box<SerializedFileWriter<File>>, group: Vec<DatagramRecord> },
}

impl DatagramTable {
    /// Begins comma-separated values.
    ///
    /// # Errors
    ///
    /// The file is there already, or cannot be written.
    pub(super) fn csv(path: &Path) -> Result<Self, Failure> {
        let form = TableForm::Csv(Box::new(csv::Writer::from_writer(created(path)?)));
        Ok(Self { path: path.to_owned(), rows: 0, form })
    }

    /// Begins a Parquet file.
    ///
    /// # Errors
    ///
    /// The file is there already, or cannot be written.
    pub(super) fn parquet(path: &Path) -> Result<Self, Failure> {
        let file = created(path)?;
        let begun = || {
            let none: &[DatagramRecord] = &[];
            let properties = WriterProperties::builder()
                .set_created_by(version::tool())
                .set_compression(Compression::ZSTD(ZstdLevel::default()))
                .build();
            SerializedFileWriter::new(file, none.schema()?, Arc::new(properties))
        };
        let writer = Box::new(begun().map_err(|error| unwritten(path, &error))?);
        let form = TableForm::Parquet { writer, group: Vec::new() };
        Ok(Self { path: path.to_owned(), rows: 0, form })
    }

    /// Adds a row.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub(super) fn write(&mut self, record: DatagramRecord) -> Result<(), Failure> {
        self.rows += 1;
        match &mut self.form {
            TableForm::Csv(writer) => {
                writer.serialize(&record).map_err(|error| unwritten(&self.path, &error))
            }
            TableForm::Parquet { writer, group } => {
                group.push(record);
                if group.len() < GROUP_ROWS {
                    return Ok(());
                }
                write_group(writer, group).map_err(|error| unwritten(&self.path, &error))
            }
        }
    }

    /// Writes what is left; gives the file and the number of its rows.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub(super) fn finish(self) -> Result<(PathBuf, u64), Failure> {
        let path = self.path;
        match self.form {
            TableForm::Csv(mut writer) => {
                writer.flush().map_err(|error| unwritten(&path, &error))?;
            }
            TableForm::Parquet { mut writer, mut group } => {
                write_group(&mut writer, &mut group)
                    .and_then(|()| writer.close())
                    .map_err(|error| unwritten(&path, &error))?;
            }
        }
        Ok((path, self.rows))
    }
}

/// Writes rows and forgets them.
fn write_group(
    writer: &mut SerializedFileWriter<File>,
    group: &mut Vec<DatagramRecord>,
) -> Result<(), ParquetError> {
    if group.is_empty() {
        return Ok(());
    }
    let mut columns = writer.next_row_group()?;
    group.as_slice().write_to_row_group(&mut columns)?;
    columns.close()?;
    group.clear();
    Ok(())
}

fn created(path: &Path) -> Result<File, Failure> {
    File::create_new(path).map_err(|error| unwritten(path, &error))
}

/// Why a table is not whole.
fn unwritten(path: &Path, error: &dyn std::error::Error) -> Failure {
    let reason = format!("{}: writing the table: {error}", path.display());
    Failure::new(reason, "make room there or name another place, and repeat the command")
}
