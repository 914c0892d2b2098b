//! Totals of a campaign.

use super::catalogue::Class;
use super::judge::Verdict;
use super::row::Row;
use serde::Serialize;
use std::collections::BTreeMap;

/// The number of faults of a class by verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Total {
    /// All faults.
    pub injected: usize,
    /// Detected: servo neutral, the ECU restarted, or its link is lost.
    pub detected: usize,
    /// Detected, and the ECU continued.
    pub tolerated: usize,
    /// Without effect.
    pub no_effect: usize,
    /// Undetected, with a waiver.
    pub waived: usize,
    /// Undetected, without a waiver.
    pub undetected: usize,
    /// Greatest latency, control ticks.
    pub worst_latency_ticks: u32,
}

/// Totals by class.
pub fn totals(rows: &[Row]) -> BTreeMap<Class, Total> {
    let mut totals: BTreeMap<Class, Total> = BTreeMap::new();
    for row in rows {
        let total = totals.entry(row.class).or_default();
        total.injected += 1;
        *match row.verdict {
            Verdict::Detected => &mut total.detected,
            Verdict::Tolerated => &mut total.tolerated,
            Verdict::NoEffect => &mut total.no_effect,
            Verdict::Undetected if row.is_failure() => &mut total.undetected,
            Verdict::Undetected => &mut total.waived,
        } += 1;
        let latency = row.latency_ticks.unwrap_or(0);
        total.worst_latency_ticks = total.worst_latency_ticks.max(latency);
    }
    totals
}
