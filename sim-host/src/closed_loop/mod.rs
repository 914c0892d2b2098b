//! The closed loop: the ECU puts out a duty each PWM period, the plant moves, and the sensors tell the ECU of it once a control
//! tick.
//!
//! | question | module |
//! |---|---|
//! | how does the vehicle move under a duty? | [`plant`] |
//! | what of the servo's voltage is torque, and what dither? | [`servo_filter`] |
//! | what do the sensors tell? | [`sensor`] |
//! | what do driver and road do, as a file? | [`manoeuvre`], [`profile`] |
//! | where does the ECU run: as a model, as software, on a processor? | [`ecu`] |
//! | who answers the ECU? | [`drive`] |
//! | what goes wrong between the two, and is it found? | [`disturbance`], [`fault`] |
//! | do all levels command the same? | [`levels`], [`run`] |
//! | what is recorded? | [`record`] of the vehicle, [`recording`] of the exchange |

pub mod disturbance;
pub mod drive;
pub mod ecu;
pub mod fault;
pub mod levels;
pub mod manoeuvre;
pub mod plant;
pub mod profile;
pub mod record;
pub mod recording;
pub mod run;
pub mod sensor;
pub mod servo_filter;
