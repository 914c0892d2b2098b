//! The ECU's dither schedules.
//!
//! Made by `sim-host schedule --from 1000 --to 2000 --step 25 --square-to 0.15 --sine-to 1.35
//! --amplitudes 30 --margin 0.25 --transient 150 --time 200 --out FILE`; not to be edited by hand.
//! Parameters: the paper's (preset `reconstruction`).
//!
//! After each amplitude are its speed, and the range of amplitudes in which trajectories from both
//! initial states have period one or come to rest, there and at the neighbouring speeds.

use crate::schedule::Schedule;

/// Wheel speeds of a schedule.
pub const POINTS: usize = 41;

/// The square wave's amplitudes.
pub const SQUARE: Schedule<f32, POINTS> = Schedule {
    first_rpm: 1000.0,
    step_rpm: 25.0,
    amplitudes_v: [
        0.0000, // 1000 rpm: none needed
        0.0000, // 1025 rpm: none needed
        0.0000, // 1050 rpm: none needed
        0.0000, // 1075 rpm: none needed
        0.0000, // 1100 rpm: none needed
        0.0000, // 1125 rpm: none needed
        0.0000, // 1150 rpm: none needed: period one and rest coexist
        0.0000, // 1175 rpm: none needed: period one and rest coexist
        0.0000, // 1200 rpm: none needed: period one and rest coexist
        0.0000, // 1225 rpm: none needed: period one and rest coexist
        0.0000, // 1250 rpm: none needed: period one and rest coexist
        0.0000, // 1275 rpm: none needed: period one and rest coexist
        0.0000, // 1300 rpm: none needed: period one and rest coexist
        0.0000, // 1325 rpm: none needed: period one and rest coexist
        0.0000, // 1350 rpm: none needed: period one and rest coexist
        0.0000, // 1375 rpm: none needed: period one and rest coexist
        0.0000, // 1400 rpm: none needed: period one and rest coexist
        0.0000, // 1425 rpm: none needed: period one and rest coexist
        0.0000, // 1450 rpm: none needed: period one and rest coexist
        0.0000, // 1475 rpm: none needed: period one and rest coexist
        0.0000, // 1500 rpm: none needed: period one and rest coexist
        0.0000, // 1525 rpm: none needed: period one and rest coexist
        0.1049, // 1550 rpm: period one from 0.0966 to 0.1300 V
        0.1055, // 1575 rpm: period one from 0.0972 to 0.1303 V
        0.1060, // 1600 rpm: period one from 0.0978 to 0.1306 V
        0.1065, // 1625 rpm: period one from 0.0983 to 0.1311 V
        0.1074, // 1650 rpm: period one from 0.0994 to 0.1314 V
        0.1081, // 1675 rpm: period one from 0.1003 to 0.1316 V
        0.1087, // 1700 rpm: period one from 0.1009 to 0.1319 V
        0.1092, // 1725 rpm: period one from 0.1016 to 0.1322 V
        0.1098, // 1750 rpm: period one from 0.1022 to 0.1325 V
        0.1103, // 1775 rpm: period one from 0.1028 to 0.1328 V
        0.1105, // 1800 rpm: period one from 0.1030 to 0.1331 V
        0.1109, // 1825 rpm: period one from 0.1034 to 0.1334 V
        0.1117, // 1850 rpm: period one from 0.1044 to 0.1338 V
        0.1120, // 1875 rpm: period one from 0.1047 to 0.1341 V
        0.1125, // 1900 rpm: period one from 0.1052 to 0.1344 V
        0.1128, // 1925 rpm: period one from 0.1056 to 0.1344 V
        0.1131, // 1950 rpm: period one from 0.1059 to 0.1347 V
        0.1134, // 1975 rpm: period one from 0.1062 to 0.1350 V
        0.1135, // 2000 rpm: period one from 0.1062 to 0.1353 V
    ],
};

/// The sine's amplitudes.
pub const SINE: Schedule<f32, POINTS> = Schedule {
    first_rpm: 1000.0,
    step_rpm: 25.0,
    amplitudes_v: [
        0.0000, // 1000 rpm: none needed
        0.0000, // 1025 rpm: none needed
        0.0000, // 1050 rpm: none needed
        0.0000, // 1075 rpm: none needed
        0.0000, // 1100 rpm: none needed
        0.0000, // 1125 rpm: none needed
        0.0000, // 1150 rpm: none needed: period one and rest coexist
        0.0000, // 1175 rpm: none needed: period one and rest coexist
        0.0000, // 1200 rpm: none needed: period one and rest coexist
        0.0000, // 1225 rpm: none needed: period one and rest coexist
        0.0000, // 1250 rpm: none needed: period one and rest coexist
        0.0000, // 1275 rpm: none needed: period one and rest coexist
        0.0000, // 1300 rpm: none needed: period one and rest coexist
        0.0000, // 1325 rpm: none needed: period one and rest coexist
        0.0000, // 1350 rpm: none needed: period one and rest coexist
        0.0000, // 1375 rpm: none needed: period one and rest coexist
        0.0000, // 1400 rpm: none needed: period one and rest coexist
        0.0000, // 1425 rpm: none needed: period one and rest coexist
        0.0000, // 1450 rpm: none needed: period one and rest coexist
        0.0000, // 1475 rpm: none needed: period one and rest coexist
        0.0000, // 1500 rpm: none needed: period one and rest coexist
        0.0000, // 1525 rpm: none needed: period one and rest coexist
        0.9323, // 1550 rpm: period one from 0.8578 to 1.1559 V
        0.9373, // 1575 rpm: period one from 0.8634 to 1.1588 V
        0.9422, // 1600 rpm: period one from 0.8691 to 1.1616 V
        0.9471, // 1625 rpm: period one from 0.8747 to 1.1644 V
        0.9541, // 1650 rpm: period one from 0.8831 to 1.1672 V
        0.9612, // 1675 rpm: period one from 0.8916 to 1.1700 V
        0.9661, // 1700 rpm: period one from 0.8972 to 1.1728 V
        0.9710, // 1725 rpm: period one from 0.9028 to 1.1756 V
        0.9759, // 1750 rpm: period one from 0.9084 to 1.1784 V
        0.9809, // 1775 rpm: period one from 0.9141 to 1.1813 V
        0.9837, // 1800 rpm: period one from 0.9169 to 1.1841 V
        0.9865, // 1825 rpm: period one from 0.9197 to 1.1869 V
        0.9932, // 1850 rpm: period one from 0.9281 to 1.1883 V
        0.9956, // 1875 rpm: period one from 0.9309 to 1.1897 V
        1.0005, // 1900 rpm: period one from 0.9366 to 1.1925 V
        1.0034, // 1925 rpm: period one from 0.9394 to 1.1953 V
        1.0062, // 1950 rpm: period one from 0.9422 to 1.1981 V
        1.0086, // 1975 rpm: period one from 0.9450 to 1.1995 V
        1.0086, // 2000 rpm: period one from 0.9450 to 1.1995 V
    ],
};
