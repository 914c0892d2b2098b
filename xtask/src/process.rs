//! Starts programs with visible progress, on a terminal and in a log.

use std::env;
use std::ffi::OsStr;
use std::io::{self, IsTerminal, PipeReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

/// After this time without output a line reports that the program is still running.
const SILENCE: Duration = Duration::from_secs(20);
/// Interval of polling a running program.
const POLL: Duration = Duration::from_millis(100);

/// How a streamed program ended.
pub enum Ended {
    /// By itself.
    With(ExitStatus),
    /// It was killed because its time was over.
    TimedOut,
}

/// Runs a program to its end with its output shown as it comes; an error if it cannot start or does
/// not succeed.
pub fn run(command: &mut Command) -> Result<()> {
    let line = display(command);
    let status = status(command)?;
    if !status.success() {
        bail!("`{line}` ended with {status}");
    }
    Ok(())
}

/// Runs a program to its end with its output shown as it comes.
pub fn status(command: &mut Command) -> Result<ExitStatus> {
    match stream(command, None)? {
        Ended::With(status) => Ok(status),
        Ended::TimedOut => unreachable!("there is no time limit"),
    }
}

/// Runs a program with its output shown as it comes, and kills it when `limit` is over.
///
/// On a terminal the program keeps the terminal, with its own progress bars and questions. In a
/// log, its two streams go through one pipe, which keeps their order, and a long silence is broken
/// by a line.
pub fn stream(command: &mut Command, limit: Option<Duration>) -> Result<Ended> {
    println!("$ {}", display(command));
    let on_terminal = io::stdout().is_terminal() && io::stderr().is_terminal();
    let started = Instant::now();
    let (mut child, output) = if on_terminal {
        (spawn(command)?, None)
    } else {
        spawn_piped(command)?
    };
    let mut last_output = started;
    loop {
        if let Some(status) = child.try_wait()? {
            // The rest of the pipe; with a limit, as a grandchild may hold its other end.
            while let Some(Ok(bytes)) = output.as_ref().map(|o| o.recv_timeout(POLL)) {
                forward(&bytes)?;
            }
            return Ok(Ended::With(status));
        }
        if limit.is_some_and(|limit| started.elapsed() > limit) {
            child.kill()?;
            child.wait()?;
            return Ok(Ended::TimedOut);
        }
        match output.as_ref().map(|o| o.recv_timeout(POLL)) {
            Some(Ok(bytes)) => {
                forward(&bytes)?;
                last_output = Instant::now();
            }
            Some(Err(RecvTimeoutError::Timeout)) if last_output.elapsed() > SILENCE => {
                println!("   still running, {} s", started.elapsed().as_secs());
                last_output = Instant::now();
            }
            Some(Err(RecvTimeoutError::Timeout)) => {}
            Some(Err(RecvTimeoutError::Disconnected)) | None => thread::sleep(POLL),
        }
    }
}

/// The standard output of a program, trimmed; `None` if it cannot start or does not succeed.
pub fn capture(command: &mut Command) -> Option<String> {
    let output = command
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output()
        .ok()?;
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// The full path of a program on PATH.
pub fn find(program: &str) -> Option<PathBuf> {
    env::split_paths(&env::var_os("PATH")?)
        .map(|folder| folder.join(program))
        .find(|path| path.is_file())
}

/// The command line.
fn display(command: &Command) -> String {
    let words = [command.get_program()]
        .into_iter()
        .chain(command.get_args());
    words
        .map(OsStr::to_string_lossy)
        .collect::<Vec<_>>()
        .join(" ")
}

fn spawn(command: &mut Command) -> Result<Child> {
    command
        .spawn()
        .with_context(|| format!("cannot start `{}`", display(command)))
}

fn spawn_piped(command: &mut Command) -> Result<(Child, Option<Receiver<Vec<u8>>>)> {
    let (reader, writer) = io::pipe()?;
    command.stdout(writer.try_clone()?).stderr(writer);
    let child = spawn(command);
    // The command holds the pipe's writing end, which must close for the reader to see the end.
    command.stdout(Stdio::null()).stderr(Stdio::null());
    Ok((child?, Some(read_in_background(reader))))
}

fn read_in_background(mut reader: PipeReader) -> Receiver<Vec<u8>> {
    let (sender, receiver) = sync_channel(16);
    thread::spawn(move || {
        let mut buffer = [0; 8192];
        while let Ok(length @ 1..) = reader.read(&mut buffer) {
            if sender.send(buffer[..length].to_vec()).is_err() {
                break;
            }
        }
    });
    receiver
}

fn forward(bytes: &[u8]) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    stdout.write_all(bytes)?;
    stdout.flush()
}
