//! A Slurm cluster of two nodes on this host, with its own configuration, key, ports and state.
//!
//! It needs root and Debian's packages slurmctld, slurmd, slurm-client and munge.

use std::fs;
use std::io;
use std::net::TcpListener;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Names of the nodes, each with one processor.
const NODES: [&str; 2] = ["one", "two"];
const PROGRAMS: [&str; 7] = [
    "munged",
    "mungekey",
    "slurmctld",
    "slurmd",
    "sbatch",
    "scontrol",
    "squeue",
];
/// Folders of system programs, which are not always on PATH.
const SYSTEM_PATHS: &str = "/usr/sbin:/sbin:/usr/bin:/bin";
/// Time for the nodes to become idle.
const START: Duration = Duration::from_secs(15);
/// Time for a daemon to end after SIGTERM.
const END: Duration = Duration::from_secs(10);
/// Life of the daemons, s, in case the test is killed.
const MOST_LIFE_S: &str = "300";
const POLL: Duration = Duration::from_millis(100);

/// A running cluster. Dropping it ends all its jobs and daemons.
#[derive(Debug)]
pub struct Cluster {
    // Ended in this order: the nodes, their controller, the authentication.
    daemons: Vec<Daemon>,
    folder: TempDir,
}

impl Cluster {
    /// Starts the daemons.
    ///
    /// # Errors
    /// The reason why this machine has no Slurm: a program is missing, the user is not root, or the
    /// nodes do not become idle.
    pub fn start() -> Result<Self, String> {
        let missing = |name: &&&str| !on_path(name);
        if let Some(program) = PROGRAMS.iter().find(missing) {
            return Err(format!("{program} is missing: run `cargo xtask setup`"));
        }
        let uid = fs::metadata("/proc/self").map(|own| own.uid());
        if uid.map_err(|error| error.to_string())? != 0 {
            return Err("Slurm's daemons need root".into());
        }
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let mut cluster = Self {
            daemons: Vec::new(),
            folder,
        };
        cluster.start_daemons().map_err(|error| error.to_string())?;
        let idle = || cluster.query("sinfo", &["-h", "-N", "-o", "%t"]) == "idle\nidle";
        if until(START, idle) {
            Ok(cluster)
        } else {
            Err(format!("the nodes do not become idle: {}", cluster.log()))
        }
    }

    fn start_daemons(&mut self) -> io::Result<()> {
        let path = |name: &str| self.folder.path().join(name);
        let argument = |option: &str, name: &str| format!("{option}={}", path(name).display());
        fs::DirBuilder::new().mode(0o700).create(path("munge"))?;
        for name in ["state", "spool-one", "spool-two"] {
            fs::create_dir(path(name))?;
        }
        let ports: [TcpListener; 3] = [
            TcpListener::bind("127.0.0.1:0")?,
            TcpListener::bind("127.0.0.1:0")?,
            TcpListener::bind("127.0.0.1:0")?,
        ];
        let mut numbers = [0; 3];
        for (number, port) in numbers.iter_mut().zip(&ports) {
            *number = port.local_addr()?.port();
        }
        drop(ports);
        fs::write(path("slurm.conf"), self.configuration(numbers)?)?;
        let mut key = Command::new("mungekey");
        key.arg("-c").arg("-k").arg(path("munge/key"));
        if !system(&mut key).status()?.success() {
            return Err(io::Error::other("mungekey failed"));
        }
        // --force: the folder may have a parent that others can write.
        let munge = [
            "--foreground".to_owned(),
            "--force".to_owned(),
            argument("--key-file", "munge/key"),
            argument("--socket", "munge/socket"),
            argument("--pid-file", "munge/pid"),
            argument("--log-file", "munge/log"),
            argument("--seed-file", "munge/seed"),
        ];
        let log = path("daemons.log");
        let munged = Daemon::start("munged", &munge, &log)?;
        until(START, || path("munge/socket").exists());
        let file = path("slurm.conf").display().to_string();
        let words = |words: &[&str]| {
            words
                .iter()
                .map(|&word| word.to_owned())
                .collect::<Vec<_>>()
        };
        let controller = Daemon::start("slurmctld", &words(&["-D", "-f", &file]), &log)?;
        for node in NODES {
            let node = Daemon::start("slurmd", &words(&["-D", "-N", node, "-f", &file]), &log)?;
            self.daemons.push(node);
        }
        self.daemons.extend([controller, munged]);
        Ok(())
    }

    /// No process tracking by control groups, no accounting, and no MPI: a container has none.
    fn configuration(&self, [controller, one, two]: [u16; 3]) -> io::Result<String> {
        let host = fs::read_to_string("/proc/sys/kernel/hostname")?;
        let host = host.trim();
        let folder = self.folder.path().display();
        let [first, second] = NODES;
        Ok(format!(
            "ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge/socket
CredType=cred/munge
MailProg=/bin/true
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SwitchType=switch/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
KillWait=5
SchedulerParameters=sched_interval=1,bf_interval=1
NodeName={first} NodeHostname={host} NodeAddr=127.0.0.1 Port={one} CPUs=1
NodeName={second} NodeHostname={host} NodeAddr=127.0.0.1 Port={two} CPUs=1
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"
        ))
    }

    /// A client's command that uses this cluster.
    pub fn command(&self, program: impl AsRef<Path>) -> Command {
        let mut command = Command::new(program.as_ref());
        system(&mut command).env("SLURM_CONF", self.folder.path().join("slurm.conf"));
        command
    }

    /// The output of a client's command, trimmed, with its messages.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn query(&self, program: &str, arguments: &[&str]) -> String {
        let output = self.command(program).args(arguments).output();
        let output = output.expect("the client's programs are there");
        let text = [output.stdout, output.stderr].concat();
        String::from_utf8_lossy(&text).trim().to_owned()
    }

    /// Waits until a condition holds. Jobs that Slurm has requeued start at once, not after its
    /// delay of two minutes.
    ///
    /// # Panics
    /// If the time is over.
    pub fn wait(&self, what: &str, limit: Duration, is_done: impl Fn(&Self) -> bool) {
        let done = until(limit, || {
            let delayed = self.query("squeue", &["-h", "-r", "-o", "%i %r"]);
            for job in delayed
                .lines()
                .filter_map(|line| line.strip_suffix(" BeginTime"))
            {
                self.query(
                    "scontrol",
                    &["update", &format!("JobId={job}"), "StartTime=now"],
                );
            }
            is_done(self)
        });
        let queue = || self.query("squeue", &["-r"]);
        assert!(
            done,
            "{what}: not after {limit:?}\n{}\n{}",
            queue(),
            self.log()
        );
    }

    /// The process of an array job's task with a text in its command line.
    ///
    /// # Panics
    /// If there is none.
    pub fn process(&self, task: u32, command: &str) -> u32 {
        let process = self.processes(&format!("SLURM_ARRAY_TASK_ID={task} "), command);
        let first = process.into_iter().next();
        first.unwrap_or_else(|| panic!("task {task} does not run {command}"))
    }

    /// Process ids of this cluster's jobs with a text in their environment and one in their command
    /// line.
    fn processes(&self, variable: &str, command: &str) -> Vec<u32> {
        let own = self.folder.path().display().to_string();
        let processes = fs::read_dir("/proc").expect("Linux has /proc");
        let ids = processes.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
        let read = |id: u32, file: &str| {
            let text = fs::read(format!("/proc/{id}/{file}")).unwrap_or_default();
            String::from_utf8_lossy(&text).replace('\0', " ")
        };
        let is_job = |&id: &u32| {
            let environment = read(id, "environ");
            environment.contains(&own)
                && environment.contains(variable)
                && read(id, "cmdline").contains(command)
        };
        ids.filter(is_job).collect()
    }

    /// The end of the controller's log.
    fn log(&self) -> String {
        let read = |name: &str| fs::read_to_string(self.folder.path().join(name));
        let text = read("slurmctld.log").unwrap_or_default();
        let lines: Vec<_> = text.lines().collect();
        lines[lines.len().saturating_sub(20)..].join("\n")
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        if self.daemons.is_empty() {
            return;
        }
        self.query("scancel", &["--signal=KILL", "--full", "--state=RUNNING"]);
        self.query("scancel", &["--user=root"]);
        until(END, || self.query("squeue", &["-h"]).is_empty());
        for daemon in &mut self.daemons {
            daemon.end();
        }
        // Of jobs that Slurm could not end.
        for id in self.processes("", "") {
            signal("KILL", id);
        }
    }
}

#[derive(Debug)]
struct Daemon(Child);

impl Daemon {
    /// Starts it below `timeout`, which passes SIGTERM on.
    fn start(program: &str, arguments: &[String], log: &Path) -> io::Result<Self> {
        let log = fs::File::options().create(true).append(true).open(log)?;
        let mut command = Command::new("timeout");
        command
            .args(["--kill-after=5", MOST_LIFE_S, program])
            .args(arguments);
        command
            .stdin(Stdio::null())
            .stdout(log.try_clone()?)
            .stderr(log);
        Ok(Self(system(&mut command).spawn()?))
    }

    fn end(&mut self) {
        signal("TERM", self.0.id());
        if !until(END, || {
            self.0.try_wait().is_ok_and(|status| status.is_some())
        }) {
            let _ = self.0.kill();
            let _ = self.0.wait();
        }
    }
}

/// Sends a signal to a process; one that has ended is no error.
pub fn signal(name: &str, process: u32) {
    let mut kill = Command::new("kill");
    kill.args([&format!("-{name}"), &process.to_string()]);
    let _ = kill.stderr(Stdio::null()).status();
}

/// Whether a condition holds before a time is over.
fn until(limit: Duration, mut is_done: impl FnMut() -> bool) -> bool {
    let started = Instant::now();
    loop {
        if is_done() {
            return true;
        }
        if started.elapsed() > limit {
            return false;
        }
        thread::sleep(POLL);
    }
}

fn paths() -> String {
    let own = std::env::var("PATH").unwrap_or_default();
    format!("{own}:{SYSTEM_PATHS}")
}

fn system(command: &mut Command) -> &mut Command {
    command.env("PATH", paths())
}

fn on_path(program: &str) -> bool {
    let mut folders = paths()
        .split(':')
        .map(PathBuf::from)
        .collect::<Vec<_>>()
        .into_iter();
    folders.any(|folder| folder.join(program).is_file())
}
