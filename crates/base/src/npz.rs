//! NPZ: ZIP archives of NumPy arrays.
//!
//! ```
//! use std::io::Cursor;
//!
//! use fringeflow_base::npz::{NpzReader, NpzWriter};
//!
//! let mut npz = NpzWriter::new(Cursor::new(Vec::new()));
//! npz.array("depth_m", &[2, 3], (0..6).map(f64::from))?;
//! let mut npz = NpzReader::new(npz.finish()?)?;
//! let depth_m = npz.array("depth_m")?.ok_or("missing")?;
//! assert_eq!(depth_m.shape(), [2, 3]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::io::{self, Read, Seek, Write};

use npyz::{AutoSerialize, DType, NpyFile, WriteOptions, WriterBuilder};
use zip::read::ZipFile;
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

/// Writes arrays without compression and with a fixed time stamp, so that equal arrays give equal bytes on any day.
pub struct NpzWriter<W: Write + Seek> {
    zip: ZipWriter<W>,
}

impl<W: Write + Seek> NpzWriter<W> {
    /// An archive without arrays.
    pub fn new(out: W) -> Self {
        Self { zip: ZipWriter::new(out) }
    }

    /// Writes an array of `shape`, last index fastest.
    ///
    /// # Errors
    /// The number of values is not that of the shape, or writing fails.
    pub fn array<T: AutoSerialize>(
        &mut self,
        name: &str,
        shape: &[u64],
        values: impl IntoIterator<Item = T>,
    ) -> io::Result<()> {
        self.start(name)?;
        let mut array = WriteOptions::new().default_dtype().shape(shape).writer(&mut self.zip).begin_nd()?;
        array.extend(values)?;
        array.finish()
    }

    /// Writes a zero-dimensional array of bytes: `str(npz["unit"].item(), "ascii")` in Python.
    ///
    /// # Errors
    /// Writing fails.
    pub fn text(&mut self, name: &str, text: &str) -> io::Result<()> {
        self.start(name)?;
        // NumPy has no byte strings of length zero.
        let type_str = format!("|S{}", text.len().max(1)).parse().map_err(io::Error::other)?;
        let array = WriteOptions::<[u8]>::new().dtype(DType::Plain(type_str)).shape(&[]);
        let mut array = array.writer(&mut self.zip).begin_nd()?;
        array.push(text.as_bytes())?;
        array.finish()
    }

    /// Writes the directory of the archive and returns what was written to.
    ///
    /// # Errors
    /// Writing fails.
    pub fn finish(self) -> io::Result<W> {
        Ok(self.zip.finish()?)
    }

    fn start(&mut self, name: &str) -> io::Result<()> {
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        Ok(self.zip.start_file(file_name(name), options.last_modified_time(DateTime::default()))?)
    }
}

/// Reads arrays, stored or deflated, as `numpy.savez` and `numpy.savez_compressed` write them.
pub struct NpzReader<R: Read + Seek> {
    zip: ZipArchive<R>,
}

impl<R: Read + Seek> NpzReader<R> {
    /// Reads the directory of the archive.
    ///
    /// # Errors
    /// This is no ZIP archive, or reading fails.
    pub fn new(file: R) -> io::Result<Self> {
        Ok(Self { zip: ZipArchive::new(file)? })
    }

    /// The names of the arrays.
    pub fn names(&self) -> impl Iterator<Item = String> {
        let array_name = |file: &str| npyz::npz::array_name_from_file_name(file).map(str::to_owned);
        self.zip.file_names().filter_map(move |file| array_name(&file.ok()?))
    }

    /// The header of an array, before its values; `None` if there is no array of this name.
    ///
    /// # Errors
    /// The array is damaged, is compressed in another way, or reading fails.
    pub fn array(&mut self, name: &str) -> io::Result<Option<NpyFile<ZipFile<'_, R>>>> {
        match self.zip.by_name(&file_name(name)) {
            Ok(file) => NpyFile::new(file).map(Some),
            Err(ZipError::FileNotFound) => Ok(None),
            Err(e) => Err(e.into()),
        }
    }
}

fn file_name(array: &str) -> String {
    npyz::npz::file_name_from_array_name(array)
}
