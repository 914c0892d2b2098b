//! The machines on which the firmware runs.

/// A machine of the emulator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Machine {
    /// Cortex-M4F.
    Mps2An386,
    /// Cortex-M7.
    Mps2An500,
    /// STM32F405, a Cortex-M4F, with the timers of the chip.
    NetduinoPlus2,
}

impl Machine {
    /// All machines.
    pub const ALL: [Self; 3] = [Self::Mps2An386, Self::Mps2An500, Self::NetduinoPlus2];

    /// Its name in the emulator.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mps2An386 => "mps2-an386",
            Self::Mps2An500 => "mps2-an500",
            Self::NetduinoPlus2 => "netduinoplus2",
        }
    }

    /// Clock of the PWM timer in the board's firmware, Hz.
    pub fn timer_clock_hz(self) -> f64 {
        match self {
            Self::Mps2An386 | Self::Mps2An500 => 25e6,
            Self::NetduinoPlus2 => 16e6,
        }
    }

    /// The emulator's options that connect a character device to the UART of the board's firmware.
    pub(crate) fn serial_options(self, device: &str) -> Vec<&str> {
        match self {
            // UART 0 is the console; UART 1 is the bus.
            Self::Mps2An386 | Self::Mps2An500 => vec!["-serial", "null", "-serial", device],
            Self::NetduinoPlus2 => vec!["-serial", device],
        }
    }

    /// Its core.
    pub fn core(self) -> &'static str {
        match self {
            Self::Mps2An386 | Self::NetduinoPlus2 => "Cortex-M4F",
            Self::Mps2An500 => "Cortex-M7",
        }
    }

    /// The firmware's board for this machine.
    pub fn board(self) -> &'static str {
        match self {
            Self::Mps2An386 | Self::Mps2An500 => "mps2",
            Self::NetduinoPlus2 => "netduinoplus2",
        }
    }

    /// Options for a repeatable run: virtual time is counted in instructions, and idle time is
    /// skipped. An instruction takes 2^5 ns. On the STM32F405 it takes 2^3 ns, because its
    /// emulated timers run about ten times faster than their nominal clock.
    pub(crate) fn instruction_shift(self) -> u32 {
        match self {
            Self::Mps2An386 | Self::Mps2An500 => 5,
            Self::NetduinoPlus2 => 3,
        }
    }

    /// Instructions per second of virtual time.
    pub fn instruction_rate_hz(self) -> f64 {
        1e9 / f64::from(1 << self.instruction_shift())
    }
}
