//! Faults of the ECU's processor, done to the firmware in the emulator through its gdb stub: bits in memory, interrupts, stack,
//! watchdog, reset. The same fault at the same tick gives the same run.

use super::accepted;
use super::campaign::Row;
use super::catalogue::{Class, Fault};
use super::injector::Injector;
use super::judge::{Judge, Outcome, Peaks};
use super::memory::Flip;
use super::tasks::Tasks;
use crate::drive::{Drive, ecu_scenario};
use crate::levels::{LevelError, Target};
use crate::manoeuvre::Manoeuvre;
use dynamics::words::counted;
use qemu::gdb::{Gdb, Register, Stop};
use qemu::qmp::Qmp;
use qemu::session::Session;
use qemu::settings;
use qemu::{RunError, SocketError};

use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::exchange::{Packet, ToEcu};
use std::fmt;
use std::path::Path;
use std::thread;
use std::time::Duration;

/// `bx lr` and `b .` as Thumb code.
const RETURN: [u8; 2] = [0x70, 0x47];
const HANG: [u8; 2] = [0xFE, 0xE7];
/// Bytes of stack that are left to an interrupt that is to overflow it.
const STACK_LEFT: u32 = 16;
/// An address where no code is.
const NOWHERE: u32 = 0xF000_0000;
/// PWM interrupts for which a control task is kept from its work: more than one control tick has.
const HELD_INTERRUPTS: u32 = 14;

/// Instructions of the control interrupt of which one is met.
const TRIED_INSTRUCTIONS: u32 = 6;
/// Stands for the exit code of an emulator that was killed by its own failure, as by a lockup of the core.
const NO_EXIT_CODE: i32 = -1;
/// Wheel speed of the bench, rpm, the driver's request, A, and the run's length, s.
const BENCH_RPM: f64 = 1750.0;
const BENCH_REQUEST_A: f64 = 0.1;
const BENCH_S: f64 = 0.15;
/// Time in which its dither ramps in, s.
const BENCH_RAMP_S: f64 = 0.02;
/// Control ticks of the bench at which its vehicle moves and its dither is on.
pub const BENCH_TICKS: std::ops::Range<u32> = 55..85;

/// What is done to the processor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Nothing but the stops, which must not matter.
    Nothing,
    /// A bit at an address is flipped.
    Flip {
        /// Address of its byte.
        address: u32,
        /// Number of the bit.
        bit: u8,
    },
    /// A bit of the stack is flipped, somewhere within the control interrupt.
    FlipStack {
        /// Says where: a number to begin with.
        seed: u32,
        /// Bytes from the stack's pointer.
        offset: u32,
        /// Number of the bit.
        bit: u8,
    },
    /// This many PWM interrupts in a row return at once.
    MissPwm(u32),
    /// The PWM interrupt runs twice.
    DoublePwm,
    /// The control interrupt returns at once.
    MissControl,
    /// The control interrupt runs twice.
    DoubleControl,
    /// PWM interrupts follow each other so closely that the control task is not done in time.
    Overrun,
    /// The main loop hangs.
    HangMainLoop,
    /// The PWM interrupt finds next to no stack left.
    OverflowStack,
    /// The PWM interrupt jumps to where no code is.
    HardFault,
    /// The machine is reset.
    Reset,
}

impl Action {
    /// Class of the fault.
    pub fn class(self) -> Class {
        match self {
            Self::Flip { .. } | Self::FlipStack { .. } => Class::Memory,
            Self::MissPwm(_)
            | Self::DoublePwm
            | Self::MissControl
            | Self::DoubleControl
            | Self::Overrun
            | Self::Nothing => Class::Timing,
            Self::HangMainLoop | Self::OverflowStack | Self::HardFault | Self::Reset => {
                Class::Processor
            }
        }
    }
}

impl Action {
    /// Its name without where.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Flip { .. } | Self::FlipStack { .. } => "bit flipped",
            Self::MissPwm(_) => "PWM interrupt missed",
            Self::DoublePwm => "PWM interrupt doubled",
            Self::MissControl => "control interrupt missed",
            Self::DoubleControl => "control interrupt doubled",
            Self::Overrun => "control task late",
            Self::HangMainLoop => "main loop hangs",
            Self::OverflowStack => "stack overflow",
            Self::HardFault => "jump to nowhere",
            Self::Reset => "reset",
        }
    }

    /// Whatever is done to the processor but flips, each once.
    pub const EVENTS: [Self; 10] = [
        Self::MissPwm(1),
        Self::MissPwm(3),
        Self::DoublePwm,
        Self::MissControl,
        Self::DoubleControl,
        Self::Overrun,
        Self::HangMainLoop,
        Self::OverflowStack,
        Self::HardFault,
        Self::Reset,
    ];
}

impl fmt::Display for Action {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Flip { address, bit } => write!(f, "bit {bit} at {address:#010x}"),
            Self::FlipStack { offset, bit, .. } => write!(f, "bit {bit} at sp + {offset}"),
            Self::MissPwm(count) => write!(f, "{} {}", self.name(), counted(count, "time")),
            _ => write!(f, "{}", self.name()),
        }
    }
}

/// A loop with the firmware in it, to be run again and again with one fault each.
#[derive(Debug, Clone)]
pub struct Bench {
    target: Target,
    scenario: Scenario<f64>,
    ecu: Scenario<f32>,
    drive: Drive,
    /// What the ECU puts out without fault, on the host.
    clean: Vec<Packet>,
    places: Places,
}

/// Addresses in the image.
#[derive(Debug, Clone, Copy)]
struct Places {
    pwm_interrupt: u32,
    control_interrupt: u32,
    /// Length of its code.
    control_bytes: u32,
    control_ticks: u32,
    idle: u32,
    stack_end: u32,
    stack_start: u32,
    return_code: u32,
}

/// A run with a fault.
#[derive(Debug, Clone, PartialEq)]
pub struct FaultyRun {
    /// What became of the fault.
    pub outcome: Outcome,
    /// What the ECU put out, one a PWM period.
    pub packets: Vec<Packet>,
}

impl Bench {
    /// With the target's firmware on a manoeuvre.
    ///
    /// # Errors
    /// If scenario or manoeuvre are not valid, or the image lacks a symbol.
    pub fn new(
        target: &Target,
        scenario: &Scenario<f64>,
        manoeuvre: &Manoeuvre,
    ) -> Result<Self, LevelError> {
        let drive = Drive::new(scenario, manoeuvre)?;
        let ecu = ecu_scenario(scenario, manoeuvre);
        let mut tasks = Tasks::new(&ecu)?;
        let mut on_host = drive.clone();
        let mut clean = Vec::new();
        for _ in 0..drive.total_periods() {
            tasks.period(&mut |from_ecu| {
                clean.push(*from_ecu);
                on_host.answer(from_ecu)
            });
        }
        Ok(Self {
            target: target.clone(),
            scenario: *scenario,
            ecu,
            drive,
            clean,
            places: Places::of(target)?,
        })
    }

    /// On a short manoeuvre whose dither is on after some 50 control ticks: until the fault the core is stopped at each of them.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn short(target: &Target) -> Result<Self, LevelError> {
        let mut scenario = Scenario::reconstruction();
        scenario.run.duration_s = BENCH_S;
        scenario.dither.waveform = Waveform::Square;
        scenario.dither.start_time_s = 0.0;
        scenario.policy.dither_ramp_s = BENCH_RAMP_S;
        Self::new(
            target,
            &scenario,
            &Manoeuvre::constant(BENCH_RPM, BENCH_REQUEST_A),
        )
    }

    /// What the ECU puts out without fault, one a PWM period.
    pub fn clean(&self) -> &[Packet] {
        &self.clean
    }

    /// Runs with a fault at a control tick, from 1.
    ///
    /// # Errors
    /// If the emulator cannot be run or steered.
    pub fn run(&self, action: Action, tick: u32) -> Result<FaultyRun, RunError> {
        let sockets = tempfile::tempdir().map_err(RunError::NotStarted)?;
        let (gdb, qmp) = (sockets.path().join("gdb"), sockets.path().join("qmp"));
        let listen = |path: &Path| format!("unix:{},server=on,wait=off", path.display());
        let (at_gdb, at_qmp) = (listen(&gdb), listen(&qmp));
        let limit = self.target.time_out;
        thread::scope(|scope| {
            let hand = Hand {
                gdb: &gdb,
                qmp: &qmp,
                places: self.places,
                limit,
            };
            let done = scope.spawn(move || hand.act(action, tick));
            let session = Session::start(
                &self.target.image,
                self.target.machine,
                &settings::of(&self.ecu),
                self.target.link,
                &["-S", "-gdb", &at_gdb, "-qmp", &at_qmp],
                limit,
            )?;
            let run = self.drive(session, tick);
            // The socket closes with the emulator, so this comes to an end too.
            let done = done.join().expect("the hand does not panic");
            let run = run?;
            // Where the firmware has ended, the stub may be gone before it says so.
            if run.packets.len() == self.clean.len() {
                done?;
            }
            Ok(run)
        })
    }

    fn drive(&self, mut session: Session, tick: u32) -> Result<FaultyRun, RunError> {
        let periods_a_tick = self.scenario.periods_per_tick();
        let mut drive = self.drive.clone();
        let mut judge = Judge::new(periods_a_tick, tick);
        let mut packets = Vec::with_capacity(self.clean.len());
        for clean in &self.clean {
            match exchange(&mut session, &mut |from_ecu| drive.answer(from_ecu)) {
                Ok(from_ecu) => {
                    packets.push(from_ecu);
                    if drive.periods() > tick * periods_a_tick {
                        judge.look(&from_ecu, clean, &drive);
                    }
                }
                Err(RunError::LinkLost { exit_code, .. }) => {
                    judge.ended(exit_code.unwrap_or(NO_EXIT_CODE), &drive);
                    break;
                }
                Err(RunError::TimedOut { .. }) => {
                    judge.fell_silent();
                    break;
                }
                Err(error) => return Err(error),
            }
        }
        Ok(FaultyRun {
            outcome: judge.conclude(false),
            packets,
        })
    }

    /// The greatest angles of the clean run from a tick on.
    fn clean_peaks(&self, tick: u32) -> Peaks {
        let mut drive = self.drive.clone();
        let mut peaks = Peaks::default();
        for packet in &self.clean {
            drive.answer(packet);
            if drive.periods() > tick * self.scenario.periods_per_tick() {
                peaks = peaks.or(Peaks::of(&drive));
            }
        }
        peaks
    }

    /// A run with a bit flipped, as a row beside those of the software.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn flip(&self, flip: &Flip) -> Result<Row, RunError> {
        let name = flip.region.name();
        self.row(
            name,
            format!("{name}: {}", flip.action),
            flip.action,
            flip.tick,
        )
    }

    /// A run with something else done to the processor, as such a row.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn event(&self, action: Action, tick: u32) -> Result<Row, RunError> {
        self.row(action.name(), action.to_string(), action, tick)
    }

    fn row(&self, kind: &str, fault: String, action: Action, tick: u32) -> Result<Row, RunError> {
        let outcome = self.run(action, tick)?.outcome;
        let tick_s = 1.0 / self.scenario.run.control_rate_hz;
        let lead_in = self.drive.total_periods() - self.drive.plant().total_periods();
        let moved = tick.saturating_sub(lead_in / self.scenario.periods_per_tick());
        Ok(Row::new(
            (action.class(), kind, fault),
            ("on the processor", "processor", f64::from(moved) * tick_s),
            &outcome,
            accepted::reason_on_processor(action),
            self.clean_peaks(tick),
        ))
    }

    /// The same fault between vehicle and ECU, or of the ECU's timing, with the ECU's program on the host and with the firmware:
    /// what each put out, one a PWM period.
    ///
    /// # Errors
    /// If the emulator cannot be run.
    pub fn both(&self, fault: Fault, tick: u32) -> Result<[Vec<Packet>; 2], LevelError> {
        let software = {
            let mut tasks = Tasks::new(&self.ecu)?;
            self.through(fault, tick, |answer| {
                tasks.period(answer);
                Ok(())
            })?
        };
        let target = &self.target;
        let mut session = Session::start(
            &target.image,
            target.machine,
            &settings::of(&self.ecu),
            target.link,
            &[],
            target.time_out,
        )?;
        let processor = self.through(fault, tick, |answer| {
            exchange(&mut session, answer).map(drop)
        })?;
        Ok([software, processor])
    }

    fn through(
        &self,
        fault: Fault,
        tick: u32,
        mut period: impl FnMut(&mut dyn FnMut(&Packet) -> Packet) -> Result<(), RunError>,
    ) -> Result<Vec<Packet>, RunError> {
        let mut drive = self.drive.clone();
        let mut between = Injector::new(&self.scenario);
        let mut packets = Vec::with_capacity(self.clean.len());
        for _ in &self.clean {
            if drive.periods() == tick * self.scenario.periods_per_tick() {
                between.begin(fault);
            }
            period(&mut |from_ecu| {
                packets.push(*from_ecu);
                drive.answer_through(&mut between, from_ecu)
            })?;
        }
        Ok(packets)
    }
}

fn exchange(
    session: &mut Session,
    answer: &mut dyn FnMut(&Packet) -> Packet,
) -> Result<Packet, RunError> {
    let received = session.receive()?;
    let packet = answer(&received.packet);
    session.send(&ToEcu {
        packet,
        stop: false,
    })?;
    Ok(received.packet)
}

/// Acts on the processor from outside.
struct Hand<'a> {
    gdb: &'a Path,
    qmp: &'a Path,
    places: Places,
    limit: Duration,
}

impl Hand<'_> {
    fn act(&self, action: Action, tick: u32) -> Result<(), SocketError> {
        let mut gdb = Gdb::connect(self.gdb, self.limit)?;
        let mut qmp = Qmp::connect(self.qmp, self.limit)?;
        self.go_to(&mut gdb, tick)?;
        let places = &self.places;
        match action {
            Action::Nothing => {}
            Action::Flip { address, bit } => flip(&mut gdb, address, bit)?,
            Action::FlipStack { seed, offset, bit } => {
                self.go_into_control_interrupt(&mut gdb, seed)?;
                let sp = gdb.read_register(Register::Sp)?;
                flip(&mut gdb, (sp + offset).min(places.stack_start - 1), bit)?;
            }
            Action::MissPwm(count) => {
                for _ in 0..count {
                    self.to_pwm_interrupt(&mut gdb)?;
                    gdb.write_register(Register::Pc, places.return_code)?;
                }
            }
            Action::DoublePwm => {
                self.to_pwm_interrupt(&mut gdb)?;
                self.call_twice(&mut gdb, places.pwm_interrupt)?;
            }
            Action::MissControl => gdb.write_register(Register::Pc, places.return_code)?,
            Action::DoubleControl => self.call_twice(&mut gdb, places.control_interrupt)?,
            Action::Overrun => {
                for _ in 0..HELD_INTERRUPTS {
                    self.to_pwm_interrupt(&mut gdb)?;
                }
            }
            Action::HangMainLoop => gdb.write_memory(places.idle, &HANG)?,
            Action::OverflowStack => {
                self.to_pwm_interrupt(&mut gdb)?;
                gdb.write_register(Register::Sp, places.stack_end + STACK_LEFT)?;
            }
            Action::HardFault => {
                self.to_pwm_interrupt(&mut gdb)?;
                gdb.write_register(Register::Pc, NOWHERE)?;
            }
            Action::Reset => {
                qmp.execute("system_reset", serde_json::json!({}))?;
            }
        }
        gdb.detach()
    }

    /// To the first instruction of the control interrupt of that tick.
    fn go_to(&self, gdb: &mut Gdb, tick: u32) -> Result<(), SocketError> {
        let interrupt = self.places.control_interrupt;
        gdb.set_breakpoint(interrupt)?;
        // An interrupt that another one preempts at its first instruction stops there twice, so its calls are not counted here.
        while self.finished_ticks(gdb)? + 1 < tick || gdb.read_register(Register::Pc)? != interrupt
        {
            self.run_to_stop(gdb)?;
        }
        gdb.remove_breakpoint(interrupt)
    }

    /// To the first instruction of the next PWM interrupt.
    fn to_pwm_interrupt(&self, gdb: &mut Gdb) -> Result<(), SocketError> {
        gdb.set_breakpoint(self.places.pwm_interrupt)?;
        self.run_to_stop(gdb)?;
        gdb.remove_breakpoint(self.places.pwm_interrupt)
    }

    /// To an instruction of the control interrupt at whose start the core is: the first that is met of some that `seed` gives. Where
    /// none is met, to the main loop behind it.
    fn go_into_control_interrupt(&self, gdb: &mut Gdb, seed: u32) -> Result<(), SocketError> {
        let Places {
            control_interrupt,
            control_bytes,
            idle,
            ..
        } = self.places;
        let mut stops: Vec<u32> = (1..=TRIED_INSTRUCTIONS)
            .map(|k| control_interrupt + ((seed.wrapping_mul(k) % control_bytes) & !1))
            .collect();
        stops.push(idle);
        stops.sort_unstable();
        stops.dedup();
        for stop in &stops {
            gdb.set_breakpoint(*stop)?;
        }
        self.run_to_stop(gdb)?;
        for stop in stops {
            gdb.remove_breakpoint(stop)?;
        }
        Ok(())
    }

    /// At the first instruction of an interrupt: runs it, and then once more.
    fn call_twice(&self, gdb: &mut Gdb, interrupt: u32) -> Result<(), SocketError> {
        let back = gdb.read_register(Register::Lr)?;
        let stack = gdb.read_register(Register::Sp)?;
        gdb.write_register(Register::Lr, interrupt | 1)?;
        gdb.set_breakpoint(interrupt)?;
        loop {
            self.run_to_stop(gdb)?;
            // Not at another interrupt's call of it, nor before its first instruction was done.
            let is_second = gdb.read_register(Register::Lr)? != interrupt | 1;
            if is_second && gdb.read_register(Register::Sp)? == stack {
                break;
            }
        }
        gdb.remove_breakpoint(interrupt)?;
        gdb.write_register(Register::Lr, back)
    }

    fn run_to_stop(&self, gdb: &mut Gdb) -> Result<(), SocketError> {
        match gdb.run_to_stop(self.limit)? {
            Stop::Breakpoint => Ok(()),
            Stop::Exited(code) => Err(SocketError::NotUnderstood(format!("exit with {code}"))),
        }
    }

    fn finished_ticks(&self, gdb: &mut Gdb) -> Result<u32, SocketError> {
        let bytes = gdb.read_memory(self.places.control_ticks, 4)?;
        let bytes = bytes.try_into().expect("as many as were asked for");
        Ok(u32::from_le_bytes(bytes))
    }
}

fn flip(gdb: &mut Gdb, address: u32, bit: u8) -> Result<(), SocketError> {
    let mut byte = gdb.read_memory(address, 1)?;
    byte[0] ^= 1 << bit;
    gdb.write_memory(address, &byte)
}

impl Places {
    fn of(target: &Target) -> Result<Self, LevelError> {
        let image = &target.image;
        let symbol = |name| image.address_of(name).ok_or(LevelError::NoSymbol { name });
        let size = |name| {
            let symbol = image.symbols().into_iter().find(|s| s.name == name);
            symbol.map(|s| s.size).ok_or(LevelError::NoSymbol { name })
        };
        let part = |name| {
            let symbol = image.symbols().into_iter().find(|s| s.name.contains(name));
            symbol
                .map(|s| s.address)
                .ok_or(LevelError::NoSymbol { name })
        };
        Ok(Self {
            pwm_interrupt: symbol("SysTick")?,
            control_interrupt: symbol("PendSV")?,
            control_bytes: size("PendSV")?,
            control_ticks: part("13CONTROL_TICKS")?,
            idle: part("$GT$4idle17h")?,
            stack_end: symbol("_stack_end")?,
            stack_start: symbol("_stack_start")?,
            return_code: image
                .find_code(RETURN)
                .ok_or(LevelError::NoSymbol { name: "bx lr" })?,
        })
    }
}
