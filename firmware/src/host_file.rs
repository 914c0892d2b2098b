//! Files of the host, through semihosting.

use cortex_m_semihosting::syscall;

/// A file of the host, open for writing.
#[derive(Debug, Clone, Copy)]
pub struct HostFile {
    handle: usize,
}

/// The host refused to open or write a file.
#[derive(Debug, Clone, Copy)]
pub struct HostFileError;

/// Mode "wb" of SYS_OPEN.
const WRITE_BINARY: usize = 5;

impl HostFile {
    /// Creates or empties the file called `path`, at most 255 bytes long.
    ///
    /// # Errors
    /// If the host cannot.
    pub fn create(path: &str) -> Result<Self, HostFileError> {
        let mut name = [0_u8; 256];
        let place = name.get_mut(..path.len()).ok_or(HostFileError)?;
        place.copy_from_slice(path.as_bytes());
        if path.len() == name.len() {
            return Err(HostFileError);
        }
        // SAFETY: the operation reads path.len() bytes of the name and the zero behind them.
        let handle = unsafe { syscall!(OPEN, name.as_ptr(), WRITE_BINARY, path.len()) };
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
}
