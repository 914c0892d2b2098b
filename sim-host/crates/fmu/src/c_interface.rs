//! The C functions of FMI 2.0 for co-simulation.
//!
//! Every pointer is checked for null, no panic leaves a function, and no function waits. Whether a
//! pointer that is not null leads to what the standard demands is the master's responsibility.

// Names and signatures are those of the standard.
#![allow(unsafe_code, non_snake_case)]

use crate::description::LOG_CATEGORY;
use crate::instance::{Instance, Refusal};
use crate::variable::Value;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

/// `fmi2Status`.
type Status = c_int;
const OK: Status = 0;
const DISCARD: Status = 2;
const ERROR: Status = 3;

/// `fmi2Type` of a unit for co-simulation.
const CO_SIMULATION: c_int = 1;
/// `fmi2StatusKind` of the last time that a step reached.
const LAST_SUCCESSFUL_TIME: c_int = 2;

/// `fmi2Component`.
type Handle = *mut c_void;
/// `fmi2CallbackLogger`.
// SAFETY: a type; its call has a reason.
type Logger =
    unsafe extern "C" fn(*mut c_void, *const c_char, Status, *const c_char, *const c_char, ...);

/// `fmi2CallbackFunctions`.
#[repr(C)]
pub struct Callbacks {
    logger: Option<Logger>,
    allocate_memory: *const c_void,
    free_memory: *const c_void,
    step_finished: *const c_void,
    environment: *mut c_void,
}

/// Where messages go.
struct Log {
    name: CString,
    logger: Option<Logger>,
    environment: *mut c_void,
}

impl Log {
    /// Sends the message of an error, which is never suppressed.
    fn error(&self, message: &str) {
        let Some(logger) = self.logger else {
            return;
        };
        // The logger formats its message as printf does.
        let message = message.replace('\0', " ").replace('%', "%%");
        let message = CString::new(message).unwrap_or_default();
        let category = CString::new(LOG_CATEGORY).unwrap_or_default();
        let (name, environment) = (self.name.as_ptr(), self.environment);
        // SAFETY: the master's function, with a format that has no arguments; all texts live until it returns.
        unsafe {
            logger(
                environment,
                name,
                ERROR,
                category.as_ptr(),
                message.as_ptr(),
            )
        }
    }
}

/// What a handle leads to.
struct Component {
    instance: Instance,
    log: Log,
}

/// What a pointer of the master leads to; `None` for null.
fn at<'a, T>(pointer: *const T) -> Option<&'a T> {
    // SAFETY: the standard demands that the pointer is null or leads to a value, which lives during the call.
    unsafe { pointer.as_ref() }
}

/// As [`at`], to be changed.
fn at_mut<'a, T>(pointer: *mut T) -> Option<&'a mut T> {
    // SAFETY: as in `at`, and no other reference exists: the standard forbids calls at the same time.
    unsafe { pointer.as_mut() }
}

/// A text of the master; `None` for null and what is not UTF-8.
fn text<'a>(pointer: *const c_char) -> Option<&'a str> {
    at(pointer)?;
    // SAFETY: not null, so the standard demands a text that ends with a zero.
    unsafe { CStr::from_ptr(pointer) }.to_str().ok()
}

fn null(what: &str) -> Refusal {
    format!("the pointer {what} is null")
}

/// An array of the master.
fn array<'a, T>(pointer: *const T, length: usize, what: &str) -> Result<&'a [T], Refusal> {
    if length == 0 {
        return Ok(&[]);
    }
    at(pointer).ok_or_else(|| null(what))?;
    // SAFETY: not null, so the standard demands that it leads to that number of elements.
    Ok(unsafe { std::slice::from_raw_parts(pointer, length) })
}

/// As [`array`], to be filled.
fn array_mut<'a, T>(pointer: *mut T, length: usize, what: &str) -> Result<&'a mut [T], Refusal> {
    if length == 0 {
        return Ok(&mut []);
    }
    at(pointer).ok_or_else(|| null(what))?;
    // SAFETY: as in `array`, and no other reference exists.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, length) })
}

/// Calls an instance. A refusal and a panic are logged, and the instance fails.
fn call(
    handle: Handle,
    function: &str,
    act: impl FnOnce(&mut Instance) -> Result<(), Refusal>,
) -> Status {
    let Some(component) = at_mut(handle.cast::<Component>()) else {
        return ERROR;
    };
    let instance = &mut component.instance;
    let refusal = match catch_unwind(AssertUnwindSafe(|| act(instance))) {
        Ok(Ok(())) => return OK,
        Ok(Err(refusal)) => refusal,
        Err(_) => "internal error; please report it with the calls that led to it".to_owned(),
    };
    component.instance.fail();
    component.log.error(&format!("{function}: {refusal}"));
    ERROR
}

/// Reads variables of one type into an array.
fn get<T>(
    (handle, function): (Handle, &str),
    (references, count): (*const u32, usize),
    values: *mut T,
    convert: impl Fn(Value) -> Option<T>,
) -> Status {
    call(handle, function, |instance| {
        let references = array(references, count, "vr")?;
        let places = array_mut(values, count, "value")?;
        for (reference, place) in references.iter().zip(places) {
            let value = instance.get(*reference)?;
            *place = convert(value).ok_or_else(|| {
                let name = instance.name(*reference).unwrap_or_default();
                format!("{name} is of the type {}", value.type_name())
            })?;
        }
        Ok(())
    })
}

/// Sets variables of one type from an array.
fn set<T: Copy>(
    (handle, function): (Handle, &str),
    (references, count): (*const u32, usize),
    values: *const T,
    convert: impl Fn(T) -> Value,
) -> Status {
    call(handle, function, |instance| {
        let references = array(references, count, "vr")?;
        let values = array(values, count, "value")?;
        for (reference, value) in references.iter().zip(values) {
            instance.set(*reference, convert(*value))?;
        }
        Ok(())
    })
}

/// A function that this unit does not have, as its description says.
fn missing(handle: Handle, function: &str) -> Status {
    call(handle, function, |_| {
        Err("not supported; see the model description".to_owned())
    })
}

/// A call without variables, which has nothing to do.
fn none_of(handle: Handle, function: &str, count: usize) -> Status {
    call(handle, function, |_| match count {
        0 => Ok(()),
        _ => Err("this unit has no such variables".to_owned()),
    })
}

fn instantiate(
    (name, kind): (*const c_char, c_int),
    guid: *const c_char,
    resources: *const c_char,
    log: &Log,
) -> Handle {
    let made = catch_unwind(|| {
        let name = text(name).filter(|name| !name.trim().is_empty());
        name.ok_or("the name of the instance is null or empty")?;
        if kind != CO_SIMULATION {
            return Err("must be for co-simulation (fmi2CoSimulation)".to_owned());
        }
        let guid = text(guid).ok_or_else(|| null("fmuGUID"))?;
        let resources = text(resources).ok_or_else(|| null("fmuResourceLocation"))?;
        Instance::new(guid, resources)
    });
    let made = made.unwrap_or_else(|_| Err("internal error; please report it".to_owned()));
    match made {
        Ok(instance) => {
            let log = Log {
                name: log.name.clone(),
                ..*log
            };
            Box::into_raw(Box::new(Component { instance, log })).cast()
        }
        Err(refusal) => {
            log.error(&format!("fmi2Instantiate: {refusal}"));
            ptr::null_mut()
        }
    }
}

macro_rules! exports {
    ($($(#[$about:meta])* fn $name:ident($($argument:ident: $Type:ty),*) -> $Result:ty $body:block)+) => {$(
        $(#[$about])*
        // SAFETY: a name of the standard, which nothing else in the library has.
        #[unsafe(no_mangle)]
        pub extern "C" fn $name($($argument: $Type),*) -> $Result $body
    )+};
}

exports! {
    /// The platform of the types: the standard's own.
    fn fmi2GetTypesPlatform() -> *const c_char {
        c"default".as_ptr()
    }

    /// The version of the standard.
    fn fmi2GetVersion() -> *const c_char {
        c"2.0".as_ptr()
    }

    /// Switches messages on and off. Errors, the only ones, are always sent.
    fn fmi2SetDebugLogging(handle: Handle, _on: c_int, count: usize, categories: *const *const c_char) -> Status {
        call(handle, "fmi2SetDebugLogging", |_| array(categories, count, "categories").map(drop))
    }

    /// Makes an instance; null if that is refused.
    fn fmi2Instantiate(
        name: *const c_char, kind: c_int, guid: *const c_char, resources: *const c_char,
        callbacks: *const Callbacks, _visible: c_int, _logging: c_int
    ) -> Handle {
        let callbacks = at(callbacks);
        let log = Log {
            name: CString::new(text(name).unwrap_or_default()).unwrap_or_default(),
            logger: callbacks.and_then(|callbacks| callbacks.logger),
            environment: callbacks.map_or(ptr::null_mut(), |callbacks| callbacks.environment),
        };
        instantiate((name, kind), guid, resources, &log)
    }

    /// Frees an instance with its stored states; nothing for null.
    fn fmi2FreeInstance(handle: Handle) -> () {
        if !handle.is_null() {
            // SAFETY: made by `instantiate`, and freed once, as the standard demands.
            drop(unsafe { Box::from_raw(handle.cast::<Component>()) });
        }
    }

    /// Start and end of the experiment. A tolerance is not used: the step is fixed.
    fn fmi2SetupExperiment(
        handle: Handle, _has_tolerance: c_int, _tolerance: f64, start_s: f64, has_stop: c_int, stop_s: f64
    ) -> Status {
        call(handle, "fmi2SetupExperiment", |instance| {
            instance.set_up_experiment(start_s, (has_stop != 0).then_some(stop_s))
        })
    }

    /// Begins the initialisation.
    fn fmi2EnterInitializationMode(handle: Handle) -> Status {
        call(handle, "fmi2EnterInitializationMode", Instance::enter_initialisation)
    }

    /// Ends the initialisation; inconsistent parameters are refused.
    fn fmi2ExitInitializationMode(handle: Handle) -> Status {
        call(handle, "fmi2ExitInitializationMode", Instance::exit_initialisation)
    }

    /// Ends the simulation.
    fn fmi2Terminate(handle: Handle) -> Status {
        call(handle, "fmi2Terminate", Instance::terminate)
    }

    /// As after `fmi2Instantiate`.
    fn fmi2Reset(handle: Handle) -> Status {
        call(handle, "fmi2Reset", Instance::reset)
    }

    /// Reads real numbers.
    fn fmi2GetReal(handle: Handle, references: *const u32, count: usize, values: *mut f64) -> Status {
        get((handle, "fmi2GetReal"), (references, count), values, |value| match value {
            Value::Real(value) => Some(value),
            _ => None,
        })
    }

    /// Reads integers and enumerations.
    fn fmi2GetInteger(handle: Handle, references: *const u32, count: usize, values: *mut c_int) -> Status {
        get((handle, "fmi2GetInteger"), (references, count), values, |value| match value {
            Value::Integer(value) => Some(value),
            _ => None,
        })
    }

    /// Reads Booleans.
    fn fmi2GetBoolean(handle: Handle, references: *const u32, count: usize, values: *mut c_int) -> Status {
        get((handle, "fmi2GetBoolean"), (references, count), values, |value| match value {
            Value::Boolean(value) => Some(value.into()),
            _ => None,
        })
    }

    /// There are no texts.
    fn fmi2GetString(handle: Handle, _references: *const u32, count: usize, _values: *mut *const c_char) -> Status {
        none_of(handle, "fmi2GetString", count)
    }

    /// Sets real numbers.
    fn fmi2SetReal(handle: Handle, references: *const u32, count: usize, values: *const f64) -> Status {
        set((handle, "fmi2SetReal"), (references, count), values, Value::Real)
    }

    /// Sets integers and enumerations.
    fn fmi2SetInteger(handle: Handle, references: *const u32, count: usize, values: *const c_int) -> Status {
        set((handle, "fmi2SetInteger"), (references, count), values, Value::Integer)
    }

    /// Sets Booleans.
    fn fmi2SetBoolean(handle: Handle, references: *const u32, count: usize, values: *const c_int) -> Status {
        set((handle, "fmi2SetBoolean"), (references, count), values, |value| Value::Boolean(value != 0))
    }

    /// There are no texts.
    fn fmi2SetString(handle: Handle, _references: *const u32, count: usize, _values: *const *const c_char) -> Status {
        none_of(handle, "fmi2SetString", count)
    }

    /// Stores the state; in the place of an earlier one, if `state` leads to one.
    fn fmi2GetFMUstate(handle: Handle, state: *mut *mut c_void) -> Status {
        call(handle, "fmi2GetFMUstate", |instance| {
            let state = at_mut(state).ok_or_else(|| null("FMUstate"))?;
            // A state is no memory of the master but a number, so that a wrong one does no harm.
            *state = ptr::without_provenance_mut(instance.store(state.addr()));
            Ok(())
        })
    }

    /// Returns to a stored state.
    fn fmi2SetFMUstate(handle: Handle, state: *mut c_void) -> Status {
        call(handle, "fmi2SetFMUstate", |instance| instance.restore(state.addr()))
    }

    /// Frees a stored state; nothing for null.
    fn fmi2FreeFMUstate(handle: Handle, state: *mut *mut c_void) -> Status {
        call(handle, "fmi2FreeFMUstate", |instance| match at_mut(state) {
            Some(state) if !state.is_null() => {
                instance.discard(state.addr())?;
                *state = ptr::null_mut();
                Ok(())
            }
            _ => Ok(()),
        })
    }

    /// Not supported.
    fn fmi2SerializedFMUstateSize(handle: Handle, _state: *mut c_void, _size: *mut usize) -> Status {
        missing(handle, "fmi2SerializedFMUstateSize")
    }

    /// Not supported.
    fn fmi2SerializeFMUstate(handle: Handle, _state: *mut c_void, _bytes: *mut u8, _size: usize) -> Status {
        missing(handle, "fmi2SerializeFMUstate")
    }

    /// Not supported.
    fn fmi2DeSerializeFMUstate(handle: Handle, _bytes: *const u8, _size: usize, _state: *mut *mut c_void) -> Status {
        missing(handle, "fmi2DeSerializeFMUstate")
    }

    /// Not supported.
    fn fmi2GetDirectionalDerivative(
        handle: Handle, _unknowns: *const u32, _unknown_count: usize, _knowns: *const u32, _known_count: usize,
        _seeds: *const f64, _derivatives: *mut f64
    ) -> Status {
        missing(handle, "fmi2GetDirectionalDerivative")
    }

    /// Not supported: inputs are held.
    fn fmi2SetRealInputDerivatives(
        handle: Handle, _references: *const u32, _count: usize, _orders: *const c_int, _values: *const f64
    ) -> Status {
        missing(handle, "fmi2SetRealInputDerivatives")
    }

    /// Not supported.
    fn fmi2GetRealOutputDerivatives(
        handle: Handle, _references: *const u32, _count: usize, _orders: *const c_int, _values: *mut f64
    ) -> Status {
        missing(handle, "fmi2GetRealOutputDerivatives")
    }

    /// Makes a step.
    fn fmi2DoStep(handle: Handle, time_s: f64, step_s: f64, _never_back: c_int) -> Status {
        call(handle, "fmi2DoStep", |instance| instance.step(time_s, step_s))
    }

    /// There is never a step to cancel: each ends with its call.
    fn fmi2CancelStep(handle: Handle) -> Status {
        missing(handle, "fmi2CancelStep")
    }

    /// No step is pending.
    fn fmi2GetStatus(_handle: Handle, _kind: c_int, _value: *mut Status) -> Status {
        DISCARD
    }

    /// The time that the last step reached; no step is pending.
    fn fmi2GetRealStatus(handle: Handle, kind: c_int, value: *mut f64) -> Status {
        if kind != LAST_SUCCESSFUL_TIME {
            return DISCARD;
        }
        call(handle, "fmi2GetRealStatus", |instance| {
            *at_mut(value).ok_or_else(|| null("value"))? = instance.time_s();
            Ok(())
        })
    }

    /// No step is pending.
    fn fmi2GetIntegerStatus(_handle: Handle, _kind: c_int, _value: *mut c_int) -> Status {
        DISCARD
    }

    /// No step is pending.
    fn fmi2GetBooleanStatus(_handle: Handle, _kind: c_int, _value: *mut c_int) -> Status {
        DISCARD
    }

    /// No step is pending.
    fn fmi2GetStringStatus(_handle: Handle, _kind: c_int, _value: *mut *const c_char) -> Status {
        DISCARD
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::archive::CONFIGURATION;
    use crate::description::guid;
    use crate::model::Model;
    use shared_model::Scenario;

    /// A panic is an error of the instance, which can be reset.
    #[test]
    fn no_panic_leaves_the_library() {
        let scenario = Scenario::reconstruction();
        let folder = tempfile::tempdir().unwrap();
        let text = dynamics::config::to_toml(&scenario);
        std::fs::write(folder.path().join(CONFIGURATION), text).unwrap();
        let own_guid = CString::new(guid(Model::Ecu, &scenario)).unwrap();
        let uri = CString::new(format!("file://{}", folder.path().display())).unwrap();
        let handle = fmi2Instantiate(
            c"one".as_ptr(),
            CO_SIMULATION,
            own_guid.as_ptr(),
            uri.as_ptr(),
            ptr::null(),
            0,
            0,
        );
        assert!(!handle.is_null());
        assert_eq!(call(handle, "a panic", |_| panic!("of the test")), ERROR);
        assert_eq!(fmi2EnterInitializationMode(handle), ERROR);
        assert_eq!(fmi2Reset(handle), OK);
        assert_eq!(fmi2EnterInitializationMode(handle), OK);
        fmi2FreeInstance(handle);
    }
}
