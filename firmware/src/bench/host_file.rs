//! Files of the host, through semihosting.

use cortex_m_semihosting::syscall;

/// A file of the host.
#[derive(Debug, Clone, Copy)]
pub struct HostFile {
    handle: usize,
}

/// The host refused to open, write or read a file.
#[derive(Debug, Clone, Copy)]
pub struct HostFileError;

/// Modes "rb" and "wb" of SYS_OPEN.
const READ_BINARY: usize = 1;
const WRITE_BINARY: usize = 5;

impl HostFile {
    /// Creates or empties the file called `path`, at most 255 bytes long.
    ///
    /// # Errors
    /// If the host cannot.
    pub fn create(path: &str) -> Result<Self, HostFileError> {
        Self::open_as(path, WRITE_BINARY)
    }

    /// Opens the file called `path`, at most 255 bytes long, for reading.
    ///
    /// # Errors
    /// If the host cannot.
    pub fn open(path: &str) -> Result<Self, HostFileError> {
        Self::open_as(path, READ_BINARY)
    }

    fn open_as(path: &str, mode: usize) -> Result<Self, HostFileError> {
        let mut name = [0_u8; 256];
        let place = name.get_mut(..path.len()).ok_or(HostFileError)?;
        place.copy_from_slice(path.as_bytes());
        if path.len() == name.len() {
            return Err(HostFileError);
        }
        // SAFETY: the operation reads path.len() bytes of the name and the zero after them.
        let handle = unsafe { syscall!(OPEN, name.as_ptr(), mode, path.len()) };
        if handle == usize::MAX {
            return Err(HostFileError);
        }
        Ok(Self { handle })
    }

    /// The console.
    ///
    /// # Errors
    /// If the host has none.
    pub fn console() -> Result<Self, HostFileError> {
        Self::create(":tt")
    }

    /// The file with the given handle, which [`handle`](Self::handle) gave.
    pub fn from_handle(handle: usize) -> Self {
        Self { handle }
    }

    /// The host's number for the file.
    pub fn handle(self) -> usize {
        self.handle
    }

    /// Writes all bytes, in one operation.
    ///
    /// # Errors
    /// If the host wrote fewer.
    pub fn write(self, bytes: &[u8]) -> Result<(), HostFileError> {
        // SAFETY: the operation reads bytes.len() bytes.
        let left = unsafe { syscall!(WRITE, self.handle, bytes.as_ptr(), bytes.len()) };
        if left == 0 {
            Ok(())
        } else {
            Err(HostFileError)
        }
    }

    /// Reads as many bytes as `bytes` has, in one operation, waiting for them where the file is a
    /// pipe.
    ///
    /// # Errors
    /// If the host gave fewer.
    pub fn read(self, bytes: &mut [u8]) -> Result<(), HostFileError> {
        // SAFETY: the operation writes at most bytes.len() bytes.
        let left = unsafe { syscall!(READ, self.handle, bytes.as_mut_ptr(), bytes.len()) };
        if left == 0 {
            Ok(())
        } else {
            Err(HostFileError)
        }
    }
}
