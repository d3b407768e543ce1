//! The ranks of MPI's world.
//!
//! One thread of each rank makes all calls of the MPI library; the other threads send it commands. It polls for messages and sleeps in between, so that a rank that waits leaves its core to
//! others, and rank 0 gives out chunks while all of its threads compute.

use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mpi::datatype::PartitionMut;
use mpi::point_to_point::{MatchedReceiveVec as _, Message, Status};
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator as _, CommunicatorCollectives as _, Destination as _, Equivalence, Source as _};
use mpi::{Count, Rank, Threading};

use super::counter::Counter;
use super::parts::{parts, trailer};
use super::{Claim, End, Ranks, Traffic, Verdict};

/// The times for which the idle thread sleeps, after so many sleeps without work.
///
/// Passes of a solver follow one another closely, chunks of form factors do not.
const NAPS: [(u32, Duration); 3] = [
    (20, Duration::from_micros(50)),
    (200, Duration::from_micros(200)),
    (u32::MAX, Duration::from_millis(2)),
];

/// The time that a rank that failed waits for the others to end as well.
const GRACE: Duration = Duration::from_secs(3);

/// The subjects of messages.
const RESULT: i32 = 1;
const CLAIM: i32 = 2;
const GRANT: i32 = 3;
const NEEDS: i32 = 4;
const END: i32 = 5;
const VERDICT: i32 = 6;

/// A grant without a chunk.
const LATER: u64 = u64::MAX - 1;
const OVER: u64 = u64::MAX;

/// All ranks of the program.
#[derive(Debug)]
pub(super) struct World {
    size: usize,
    rank: usize,
    host: String,
    commands: Sender<Command>,
    shared: Arc<Shared>,
    /// The number of tasks so far.
    n_works: AtomicU64,
    thread: Mutex<Option<JoinHandle<()>>>,
}

/// The requests that the thread serves.
#[derive(Debug)]
enum Command {
    AllGather(Vec<u8>, SyncSender<Vec<Vec<u8>>>),
    AllGatherNumbers(Vec<f64>, SyncSender<Vec<f64>>),
    Claim([u64; 3], SyncSender<Claim>),
    Needs([u64; 2]),
    Post(Vec<Vec<u8>>),
    End(End, SyncSender<Verdict>),
    Abort(u8),
}

/// Chunks with their results, by task.
type Inbox = BTreeMap<u64, Vec<(u64, Vec<u8>)>>;

/// The state for threads that do not call MPI.
#[derive(Debug, Default)]
struct Shared {
    /// Results of chunks, by task.
    inbox: Mutex<Inbox>,
    came: Condvar,
    traffic: Mutex<Traffic>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl World {
    /// Initialises MPI.
    pub(super) fn start() -> Self {
        let (commands, heard) = channel();
        let (tell, told) = sync_channel(1);
        let shared = Arc::new(Shared::default());
        let of_thread = Arc::clone(&shared);
        let thread = std::thread::spawn(move || {
            // It fails where MPI is initialised already, which happens nowhere else.
            let Some((universe, _)) = mpi::initialize_with_threading(Threading::Funneled) else {
                return;
            };
            let world = universe.world();
            let host = mpi::environment::processor_name().unwrap_or_default();
            let _ = tell.send((at(world.size()), at(world.rank()), host));
            Thread::new(world, heard, of_thread).run();
            drop(universe);
        });
        let (size, rank, host) = told.recv().expect("MPI is initialised once");
        Self {
            size,
            rank,
            host,
            commands,
            shared,
            n_works: AtomicU64::new(0),
            thread: Mutex::new(Some(thread)),
        }
    }

    fn tell(&self, command: Command) {
        self.commands.send(command).expect("MPI's thread lives until the end");
    }

    /// Returns the answer to a command.
    fn ask<T>(&self, command: impl FnOnce(SyncSender<T>) -> Command) -> T {
        let (reply, answer) = sync_channel(1);
        self.tell(command(reply));
        answer.recv().expect("MPI's thread answers")
    }
}

impl Ranks for World {
    fn size(&self) -> usize {
        self.size
    }

    fn rank(&self) -> usize {
        self.rank
    }

    fn host(&self) -> &str {
        &self.host
    }

    fn all_gather(&self, own: &[u8]) -> Vec<Vec<u8>> {
        self.ask(|reply| Command::AllGather(own.to_vec(), reply))
    }

    fn all_gather_numbers(&self, own: &[f64]) -> Vec<f64> {
        self.ask(|reply| Command::AllGatherNumbers(own.to_vec(), reply))
    }

    fn begin(&self) -> u64 {
        let number = self.n_works.fetch_add(1, Ordering::Relaxed);
        // Late results of earlier work are not needed.
        locked(&self.shared.inbox).retain(|&work, _| work >= number);
        number
    }

    fn claim(&self, work: u64, n: u64, window: u64) -> Claim {
        self.ask(|reply| Command::Claim([work, n, window], reply))
    }

    fn needs(&self, work: u64, chunk: u64) {
        self.tell(Command::Needs([work, chunk]));
    }

    fn post(&self, work: u64, chunk: u64, result: Vec<u8>) {
        self.tell(Command::Post(parts(work, chunk, result)));
    }

    fn posted(&self, work: u64, wait: Duration) -> Vec<(u64, Vec<u8>)> {
        let has_nothing = |inbox: &mut Inbox| !inbox.contains_key(&work);
        let locked = locked(&self.shared.inbox);
        let waited = self.shared.came.wait_timeout_while(locked, wait, has_nothing);
        let (mut inbox, _) = waited.unwrap_or_else(PoisonError::into_inner);
        inbox.remove(&work).unwrap_or_default()
    }

    fn traffic(&self) -> Traffic {
        *locked(&self.shared.traffic)
    }

    fn end(&self, end: End) -> Verdict {
        let verdict = self.ask(|reply| Command::End(end, reply));
        if !verdict.aborts
            && let Some(thread) = locked(&self.thread).take()
        {
            // A thread that panicked has reported it.
            let _ = thread.join();
        }
        verdict
    }

    fn abort(&self, code: u8) -> ! {
        // Without the thread, no rank is left to end.
        let _ = self.commands.send(Command::Abort(code));
        std::thread::sleep(GRACE);
        std::process::exit(code.into())
    }
}

/// The thread that calls MPI.
struct Thread {
    world: Rc<SimpleCommunicator>,
    size: usize,
    rank: usize,
    commands: Receiver<Command>,
    shared: Arc<Shared>,
    /// Commands that take time, in order.
    waiting: VecDeque<Command>,
    /// The ranks that wait for a chunk here.
    claiming: Option<SyncSender<Claim>>,
    /// First parts of results, by ranks.
    begun: BTreeMap<Rank, Vec<u8>>,
    /// On rank 0: the chunks that are given out.
    counters: BTreeMap<u64, Counter>,
    /// On rank 0: the ranks that have ended.
    ends: BTreeMap<usize, End>,
    /// On rank 0: the time of the first failure.
    failed: Option<Instant>,
    /// The ranks that wait for the end of the program.
    ending: Option<SyncSender<Verdict>>,
    is_over: bool,
    /// The number of sleeps since the last work.
    n_naps: u32,
}

impl Thread {
    fn new(world: SimpleCommunicator, commands: Receiver<Command>, shared: Arc<Shared>) -> Self {
        Self {
            size: at(world.size()),
            rank: at(world.rank()),
            world: Rc::new(world),
            commands,
            shared,
            waiting: VecDeque::new(),
            claiming: None,
            begun: BTreeMap::new(),
            counters: BTreeMap::new(),
            ends: BTreeMap::new(),
            failed: None,
            ending: None,
            is_over: false,
            n_naps: 0,
        }
    }

    fn run(mut self) {
        while !self.is_over {
            let busy = self.serve();
            match self.waiting.pop_front() {
                Some(Command::Post(parts)) => self.send_to_all(parts),
                Some(Command::AllGather(own, reply)) => {
                    let _ = reply.send(self.all_gather(&own));
                }
                Some(Command::AllGatherNumbers(own, reply)) => {
                    let _ = reply.send(self.all_gather_slices(&own, 0.0));
                }
                _ if !busy => self.nap(),
                _ => {}
            }
        }
    }

    /// Sleeps until there is a command, or for a short while.
    fn nap(&mut self) {
        let nap = NAPS.iter().find(|(most, _)| self.n_naps < *most).unwrap_or(&NAPS[2]).1;
        self.n_naps = self.n_naps.saturating_add(1);
        match self.commands.recv_timeout(nap) {
            Ok(command) => {
                self.n_naps = 0;
                self.hear(command);
            }
            Err(RecvTimeoutError::Timeout) => {}
            // The program ends silently: the launcher ends the others.
            Err(RecvTimeoutError::Disconnected) => std::thread::sleep(nap),
        }
    }

    /// Receives commands and messages, and answers those that take no time; returns whether there was any.
    fn serve(&mut self) -> bool {
        let mut busy = false;
        while let Ok(command) = self.commands.try_recv() {
            self.hear(command);
            busy = true;
        }
        while let Some(found) = self.world.any_process().immediate_matched_probe() {
            self.receive(found);
            busy = true;
        }
        if self.rank == 0 {
            self.judge();
        }
        if busy {
            self.n_naps = 0;
        }
        busy
    }

    fn hear(&mut self, command: Command) {
        match command {
            Command::Claim(asked, reply) => {
                self.claiming = Some(reply);
                if self.rank == 0 {
                    let answer = self.grant(asked);
                    self.granted(answer);
                } else {
                    self.send(0, CLAIM, &asked);
                }
            }
            Command::Needs(reached) if self.rank == 0 => self.note(0, reached),
            Command::Needs(reached) => self.send(0, NEEDS, &reached),
            Command::End(end, reply) => {
                self.ending = Some(reply);
                if self.rank == 0 {
                    self.note_end(0, end);
                } else {
                    self.send(0, END, &[u64::from(end.code), u64::from(end.failed)]);
                }
            }
            Command::Abort(code) => self.world.abort(code.into()),
            long @ (Command::Post(_) | Command::AllGather(..) | Command::AllGatherNumbers(..)) => {
                self.waiting.push_back(long);
            }
        }
    }

    fn receive(&mut self, found: (Message, Status)) {
        let (from, tag) = (found.1.source_rank(), found.1.tag());
        if tag == RESULT {
            let (part, _) = found.matched_receive_vec::<u8>();
            self.take_in(from, part);
            return;
        }
        let (numbers, _) = found.matched_receive_vec::<u64>();
        match (tag, numbers.as_slice()) {
            (CLAIM, &[work, n, window]) => {
                let answer = self.grant([work, n, window]);
                self.send(from, GRANT, &[answer]);
            }
            (GRANT, &[answer]) => self.granted(answer),
            (NEEDS, &[work, chunk]) => self.note(at(from), [work, chunk]),
            (END, &[code, failed]) => {
                let end = End {
                    code: u8::try_from(code).unwrap_or(1),
                    failed: failed != 0,
                };
                self.note_end(at(from), end);
            }
            (VERDICT, &[code, speaks, aborts]) => self.judged(Verdict {
                code: u8::try_from(code).unwrap_or(1),
                speaks: speaks != 0,
                aborts: aborts != 0,
            }),
            _ => unreachable!("no rank sends {numbers:?} as {tag}"),
        }
    }

    /// Receives a part of a result.
    fn take_in(&mut self, from: Rank, mut part: Vec<u8>) {
        let Some([work, chunk, more]) = trailer(&mut part) else {
            unreachable!("every part says where it belongs");
        };
        let result = match self.begun.remove(&from) {
            Some(mut first) => {
                first.append(&mut part);
                first
            }
            None => part,
        };
        if more != 0 {
            self.begun.insert(from, result);
            return;
        }
        locked(&self.shared.inbox)
            .entry(work)
            .or_default()
            .push((chunk, result));
        self.shared.came.notify_all();
    }

    /// On rank 0: gives out a chunk.
    fn grant(&mut self, [work, n, window]: [u64; 3]) -> u64 {
        match self.counter(work).claim(n, window) {
            Claim::Given(chunk) => chunk,
            Claim::Later => LATER,
            Claim::Over => OVER,
        }
    }

    fn counter(&mut self, work: u64) -> &mut Counter {
        self.counters.entry(work).or_insert_with(|| Counter::new(self.size))
    }

    fn granted(&mut self, answer: u64) {
        let claim = match answer {
            LATER => Claim::Later,
            OVER => Claim::Over,
            chunk => Claim::Given(chunk),
        };
        if let Some(reply) = self.claiming.take() {
            let _ = reply.send(claim);
        }
    }

    /// On rank 0: records the progress of a rank.
    fn note(&mut self, rank: usize, [work, chunk]: [u64; 2]) {
        self.counter(work).needs(rank, chunk);
    }

    /// On rank 0: records that a rank has ended.
    fn note_end(&mut self, rank: usize, end: End) {
        if end.failed {
            self.failed.get_or_insert_with(Instant::now);
        }
        self.ends.insert(rank, end);
    }

    /// On rank 0: decides the end of the program, once all ranks have ended, or some time after one failed.
    fn judge(&mut self) {
        let first_failed = self.ends.iter().find(|(_, end)| end.failed);
        let all_ended = self.ends.len() == self.size;
        if !all_ended && self.failed.is_none_or(|failed| failed.elapsed() < GRACE) {
            return;
        }
        let speaker = first_failed.map(|(&rank, _)| rank);
        let code = first_failed
            .or(self.ends.first_key_value())
            .map_or(1, |(_, end)| end.code);
        let verdict = |rank: usize| Verdict {
            code,
            speaks: speaker == Some(rank),
            aborts: !all_ended,
        };
        let told: Vec<usize> = match speaker {
            Some(speaker) if !all_ended => vec![speaker],
            _ => (0..self.size).collect(),
        };
        self.failed = None;
        self.ends.clear();
        for rank in told.into_iter().rev() {
            let own = verdict(rank);
            if rank == 0 {
                self.judged(own);
            } else {
                let numbers = [own.code.into(), own.speaks.into(), own.aborts.into()];
                self.send(Rank::try_from(rank).unwrap_or(Rank::MAX), VERDICT, &numbers);
            }
        }
    }

    fn judged(&mut self, verdict: Verdict) {
        self.is_over = !verdict.aborts;
        if let Some(reply) = self.ending.take() {
            let _ = reply.send(verdict);
        }
    }

    /// Sends a few numbers, which MPI buffers.
    fn send(&self, to: Rank, tag: i32, numbers: &[u64]) {
        self.count_messages(1, size_of_val(numbers));
        self.world.process_at_rank(to).send_with_tag(numbers, tag);
    }

    fn count_messages(&self, n: usize, n_byte: usize) {
        let mut traffic = locked(&self.shared.traffic);
        traffic.n_messages += n as u64;
        traffic.message_byte += (n * n_byte) as u64;
    }

    /// Sends parts of a result to all other ranks, in order, and answers others meanwhile.
    fn send_to_all(&mut self, parts: Vec<Vec<u8>>) {
        let world = Rc::clone(&self.world);
        let others: Vec<Rank> = (0..world.size()).filter(|&other| other != world.rank()).collect();
        for part in parts {
            self.count_messages(others.len(), part.len());
            mpi::request::scope(|scope| {
                let begin = |&other: &Rank| {
                    let process = world.process_at_rank(other);
                    process.immediate_send_with_tag(scope, part.as_slice(), RESULT)
                };
                let mut requests: Vec<_> = others.iter().map(begin).collect();
                loop {
                    requests = requests
                        .into_iter()
                        .filter_map(|request| request.test().err())
                        .collect();
                    if requests.is_empty() {
                        break;
                    }
                    if !self.serve() {
                        self.nap();
                    }
                }
            });
        }
    }

    /// Waits until all ranks are here, and answers others meanwhile: one that still claims chunks must not be left waiting.
    fn meet(&mut self) {
        let world = Rc::clone(&self.world);
        let mut request = world.immediate_barrier();
        while let Err(unfinished) = request.test() {
            request = unfinished;
            if !self.serve() {
                self.nap();
            }
        }
    }

    fn all_gather(&mut self, own: &[u8]) -> Vec<Vec<u8>> {
        let lengths = self.lengths(own.len());
        let mut rest = self.all_gather_slices(own, 0);
        lengths
            .iter()
            .map(|&length| {
                let after = rest.split_off(at(length));
                std::mem::replace(&mut rest, after)
            })
            .collect()
    }

    /// Returns the length of each rank's data.
    fn lengths(&mut self, own: usize) -> Vec<Count> {
        self.meet();
        let own = Count::try_from(own).expect("MPI counts in 31 bits");
        let mut lengths = vec![0; self.size];
        self.world.all_gather_into(&own, &mut lengths[..]);
        lengths
    }

    fn all_gather_slices<T: Equivalence + Clone>(&mut self, own: &[T], nothing: T) -> Vec<T> {
        let lengths = self.lengths(own.len());
        let starts: Vec<Count> = lengths
            .iter()
            .scan(0, |next: &mut Count, &length| {
                let start = *next;
                *next = next.checked_add(length).expect("MPI counts in 31 bits");
                Some(start)
            })
            .collect();
        let mut all = vec![nothing; lengths.iter().map(|&length| at(length)).sum()];
        let mut traffic = locked(&self.shared.traffic);
        traffic.n_collective += 1;
        traffic.collective_byte += size_of_val(own) as u64;
        drop(traffic);
        if all.is_empty() {
            return all;
        }
        // The slice of no bytes that Rust makes has the address 1, which Open MPI takes for `MPI_IN_PLACE`.
        let one = [all[0].clone()];
        let own = if own.is_empty() { &one[..0] } else { own };
        let mut partition = PartitionMut::new(&mut all[..], lengths, starts);
        self.world.all_gather_varcount_into(own, &mut partition);
        all
    }
}

/// Returns a number of MPI, which is not negative.
fn at(number: i32) -> usize {
    usize::try_from(number).unwrap_or(0)
}
