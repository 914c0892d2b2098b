//! Peers from crates.io, and the shared model's coefficients for the others.
//!
//! `peers export` prints coefficients, reference values of the right-hand side, and this program's
//! own values there. `peers PEER JOB TOLERANCE SECONDS` runs a job once and prints its outcome.
//! Both print JSON.

mod differential_equations;
mod diffsol;
mod export;
mod job;
mod model;
mod ode_solvers;

use serde_json::json;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["export"] => export(),
        [peer, job, tolerance, until_s] => {
            let tolerance = tolerance.parse().expect("a tolerance");
            let until_s = until_s.parse().expect("a time, s");
            let outcome = match peer {
                "ode_solvers" => ode_solvers::run(job, tolerance, until_s),
                "differential-equations" => differential_equations::run(job, tolerance, until_s),
                "diffsol" => diffsol::run(job, tolerance, until_s),
                _ => panic!("no peer {peer}"),
            };
            println!(
                "{}",
                json!(outcome.expect("a job that the peer can express"))
            );
        }
        _ => panic!("usage: peers export | peers PEER JOB TOLERANCE SECONDS"),
    }
}

fn export() {
    let (lanes, samples) = (export::coefficients(), export::samples());
    let own: Vec<_> = samples
        .iter()
        .map(|s| {
            let c = &lanes[s.lane];
            (
                c.rates(&s.x, s.friction_nm, s.free),
                c.tangent_rates(&s.x, &s.tangent),
            )
        })
        .collect();
    let all = json!({
        "start": model::START,
        "tangent_start": model::TANGENT_START,
        "tangent_norm": model::TANGENT_NORM,
        "renormalisation_s": model::RENORMALISATION_S,
        "lanes": lanes,
        "samples": samples,
        "own": own,
    });
    println!("{all}");
}
