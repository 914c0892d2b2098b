//! The map: exponent, period, extent and kind of the motion over wheel speed N and dither amplitude
//! W.
//!
//! | question | module |
//! |---|---|
//! | which cells? | [`plan`] |
//! | what is found in a cell? | [`cell`] |
//! | how is it computed piece by piece, on one machine or several? | [`tiles`] |
//! | how do data tools read it? | [`table`] |
//! | how is it drawn? | [`figure`] |
//!
//! A map is made in tiles, each kept as a file of its own as soon as it is done. What a cell holds
//! depends on the plan alone: not on threads, on interruptions, or on where its tile was made.

mod arrow_schema;
pub mod cell;
mod curves;
pub mod figure;
pub mod plan;
pub mod table;
pub mod tiles;
