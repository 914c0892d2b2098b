#![doc = include_str!("../README.md")]

mod feedback;
mod measured;
mod motion;
mod settings;

use serde::Serialize;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::policy::Suppression;
use std::sync::Mutex;

/// Longest text that the page may pass, bytes: many times the length of a link with all settings.
const MOST_INPUT: usize = 8192;

/// Text from the page, and the results of the last calls.
struct Interface {
    input: Vec<u8>,
    scenario: Option<Scenario<f32>>,
    /// Indexed by [`Output`].
    outputs: [Vec<u8>; 3],
}

/// What [`output`] and [`output_length`] refer to.
#[derive(Clone, Copy)]
enum Output {
    /// JSON of the last call, or its error message.
    Message = 0,
    /// States, four f32 per step.
    States = 1,
    /// Duty codes, u16.
    Duties = 2,
}

static INTERFACE: Mutex<Interface> = Mutex::new(Interface {
    input: Vec::new(),
    scenario: None,
    outputs: [const { Vec::new() }; 3],
});

impl Interface {
    fn text(&self) -> Result<&str, String> {
        std::str::from_utf8(&self.input).map_err(|error| format!("no UTF-8 text: {error}"))
    }

    fn scenario(&self) -> Result<&Scenario<f32>, String> {
        let scenario = self.scenario.as_ref();
        scenario.ok_or_else(|| String::from("no scenario is configured"))
    }

    fn set(&mut self, output: Output, bytes: impl IntoIterator<Item = u8>) {
        let place = &mut self.outputs[output as usize];
        place.clear();
        place.extend(bytes);
    }

    fn set_motion(&mut self, motion: &motion::Motion) {
        let words = motion.states.iter().flatten();
        self.set(Output::States, words.flat_map(|word| word.to_le_bytes()));
        let codes = motion.duties.iter();
        self.set(Output::Duties, codes.flat_map(|code| code.to_le_bytes()));
    }
}

/// Runs a call; its answer is in the message, as JSON, or the reason why there is none.
fn answer<A: Serialize>(call: impl FnOnce(&mut Interface) -> Result<A, String>) -> bool {
    let Ok(mut interface) = INTERFACE.lock() else {
        return false;
    };
    let answer = call(&mut interface).and_then(|answer| {
        serde_json::to_string(&answer).map_err(|error| format!("no answer: {error}"))
    });
    let is_ok = answer.is_ok();
    let text = answer.unwrap_or_else(|error| error);
    interface.set(Output::Message, text.into_bytes());
    is_ok
}

/// Address of a place for a text of `length` bytes, the input of the next call; null if it is too
/// long.
// SAFETY: the only symbol of this name.
#[unsafe(no_mangle)]
pub extern "C" fn input(length: usize) -> *mut u8 {
    let Ok(mut interface) = INTERFACE.lock() else {
        return std::ptr::null_mut();
    };
    if length > MOST_INPUT {
        return std::ptr::null_mut();
    }
    interface.input = vec![0; length];
    interface.input.as_mut_ptr()
}

/// Address of an output; null if there is none of that number. Valid until the next call.
// SAFETY: the only symbol of this name.
#[unsafe(no_mangle)]
pub extern "C" fn output(number: usize) -> *const u8 {
    let Ok(interface) = INTERFACE.lock() else {
        return std::ptr::null();
    };
    let output = interface.outputs.get(number);
    output.map_or(std::ptr::null(), |output| output.as_ptr())
}

/// Length of an output, bytes.
// SAFETY: the only symbol of this name.
#[unsafe(no_mangle)]
pub extern "C" fn output_length(number: usize) -> usize {
    let Ok(interface) = INTERFACE.lock() else {
        return 0;
    };
    interface.outputs.get(number).map_or(0, Vec::len)
}

/// Makes the scenario of the settings in the input, and answers with it. On an error the last
/// scenario stays.
// SAFETY: the only symbol of this name.
#[unsafe(no_mangle)]
pub extern "C" fn configure() -> bool {
    answer(|interface| {
        let scenario = settings::scenario(interface.text()?)?;
        motion::check(&scenario)?;
        interface.scenario = Some(scenario);
        Ok(scenario)
    })
}

/// Answers with least and greatest allowed value of the number that the input names.
// SAFETY: the only symbol of this name.
#[unsafe(no_mangle)]
pub extern "C" fn range() -> bool {
    answer(|interface| {
        let key = interface.text()?;
        Scenario::<f32>::range(key).ok_or_else(|| format!("{key}: no number of that name"))
    })
}

/// Runs the scenario; `suppressed` is false for the same motion without dither and feedback.
// SAFETY: the only symbol of this name.
#[unsafe(no_mangle)]
pub extern "C" fn run(suppressed: bool) -> bool {
    answer(|interface| {
        let mut scenario = *interface.scenario()?;
        if !suppressed {
            scenario.dither.waveform = Waveform::None;
            scenario.controller.suppression = Suppression::None;
        }
        let motion = motion::run(&scenario)?;
        interface.set_motion(&motion);
        Ok(motion.facts)
    })
}

/// Measures period, exponent and regime of the settled motion; the states are then those of its
/// end.
// SAFETY: the only symbol of this name.
#[unsafe(no_mangle)]
pub extern "C" fn measure() -> bool {
    answer(|interface| {
        let (measured, end) = measured::measure(interface.scenario()?)?;
        interface.set_motion(&end);
        Ok(measured)
    })
}
