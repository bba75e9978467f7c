//! What is left of processes that were killed does no harm.

use std::{
    fs::{self, OpenOptions},
    os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt, symlink},
    path::Path,
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant, SystemTime},
};

use pdk_bus::{BASE_VARIABLE, Bus, Tap, Topic, remove, sweep, sweep_run};

use crate::peer::{
    HEIGHT, Peer, SECOND, SOON, WIDTH, frame, is_intact, own_base, publish, roots, shared_memory, unique,
};

/// Different delays every time, up to `longest` and more often short than long.
fn delays(longest: Duration) -> impl Iterator<Item = Duration> {
    let mut state = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap().as_nanos() as u64 | 1;
    println!("delays from {state}");
    std::iter::from_fn(move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        let part = (state >> 11) as f64 / (1_u64 << 53) as f64;
        Some(longest.mul_f64(part * part))
    })
}

/// A file as iceoryx2 leaves it if it is killed between making and filling it.
fn plant(file: &Path) {
    let _ = fs::remove_file(file);
    OpenOptions::new().write(true).create_new(true).mode(0o200).open(file).unwrap();
}

/// Does what would wait without end for a process that is gone. The limit is far above what it takes on a machine that is busy with other work.
fn quick<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    assert!(start.elapsed() < SOON, "{what} took {:?}", start.elapsed());
    result
}

#[test]
fn what_processes_leave_that_are_killed_while_they_make_their_bus_does_no_harm() {
    let Some(base) =
        own_base("killed::what_processes_leave_that_are_killed_while_they_make_their_bus_does_no_harm")
    else {
        return;
    };
    let run = unique("maker");
    let mut stages = [0; 3];
    // Where a bus takes longer to make, as on a busy machine, longer delays follow, until one was complete.
    let lengths = [50, 200, 1000, 5000].map(Duration::from_millis);
    for (round, delay) in lengths.into_iter().flat_map(|longest| delays(longest).take(60)).enumerate() {
        if round % 60 == 0 && stages[1] > 0 && stages[2] > 0 {
            break;
        }
        let maker = Peer::start("maker", &run);
        std::thread::sleep(delay);
        maker.kill();

        let left = roots(&base);
        let memory: usize = left.iter().map(|root| shared_memory(root).len()).sum();
        let stage =
            usize::from(memory > 0) + usize::from(left.iter().any(|r| r.join("iceoryx2.toml").exists()));
        stages[stage] += 1;
        assert!(Tap::list().unwrap().is_empty());
        // In half of the rounds the next bus comes before the sweep.
        let bus = (round % 2 == 0)
            .then(|| quick("the bus beside leftovers", || Bus::create(&run, 0, WIDTH, HEIGHT).unwrap()));
        let removed = quick("the sweep", || sweep_run(&run).unwrap());
        assert!(removed <= left.len(), "round {round}");
        for root in &left {
            assert!(!root.exists(), "round {round}: {root:?}");
            assert!(shared_memory(root).is_empty(), "round {round}: {root:?}");
        }
        let bus = bus.unwrap_or_else(|| {
            quick("the bus after the sweep", || Bus::create(&run, 0, WIDTH, HEIGHT).unwrap())
        });
        publish(&bus, 0);
        assert_eq!(sweep().unwrap(), 0);
        publish(&bus, 1);
    }
    println!("killed before any shared memory, in the middle, with a complete bus: {stages:?}");
    assert!(stages[1] > 0 && stages[2] > 0, "{stages:?}");
}

#[test]
fn half_made_files_of_one_bus_do_not_disturb_another() {
    let Some(base) = own_base("killed::half_made_files_of_one_bus_do_not_disturb_another") else { return };
    let run = unique("planted");
    let mut publisher = Peer::start("publisher", &run);
    let tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
    publisher.command("1");
    publisher.kill();
    drop(tap);
    let [root] = roots(&base).try_into().unwrap();
    for sort in [".connection", ".dynamic", ".global_mgmt"] {
        let files = shared_memory(&root);
        let of_sort: Vec<_> = files.iter().filter(|file| file.to_str().unwrap().ends_with(sort)).collect();
        assert!(!of_sort.is_empty(), "{sort}: {files:?}");
        of_sort.into_iter().for_each(|file| plant(file));
    }

    let bus = quick("the bus", || Bus::create(&run, 0, WIDTH, HEIGHT).unwrap());
    let mut tap = quick("the tap", || Tap::open(&run, 0, Topic::Raw, SECOND).unwrap());
    publish(&bus, 0);
    assert!(is_intact(&run, 0, &frame(&mut tap, SOON).expect("a frame")));
    assert_eq!(quick("the sweep", || sweep().unwrap()), 1);
    assert!(!root.exists());
    assert!(shared_memory(&root).is_empty());
    publish(&bus, 1);
    assert!(is_intact(&run, 1, &frame(&mut tap, SOON).expect("a frame")));
}

#[test]
fn taps_killed_while_they_open_hurt_neither_the_loop_nor_other_taps() {
    let Some(_) = own_base("killed::taps_killed_while_they_open_hurt_neither_the_loop_nor_other_taps") else {
        return;
    };
    let run = unique("opener");
    let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
    let mut sequence = 0;
    for delay in delays(Duration::from_millis(60)).take(12) {
        let opener = Peer::start("opener", &run);
        let start = Instant::now();
        while start.elapsed() < delay {
            quick("publishing", || publish(&bus, sequence));
            sequence += 1;
        }
        opener.kill();
        (0..30).for_each(|_| quick("publishing", || publish(&bus, sequence)));
        let start = Instant::now();
        let mut tap = Tap::open(&run, 0, Topic::Raw, Duration::ZERO).unwrap();
        assert!(start.elapsed() < SOON, "{:?}", start.elapsed());
        publish(&bus, sequence);
        assert!(frame(&mut tap, SOON).is_some());
    }

    // What is hardest to hit by chance: it is killed while it makes its connection, for which iceoryx2 would wait
    // when it clears up. The loop never sees such a tap; here it has seen it while it was whole.
    let before = shared_memory(bus.root());
    let holder = Peer::start("holder", &run);
    publish(&bus, sequence);
    holder.kill();
    let of_the_killed: Vec<_> =
        shared_memory(bus.root()).into_iter().filter(|f| !before.contains(f)).collect();
    let [connection] = &of_the_killed[..] else { panic!("{of_the_killed:?}") };
    assert!(connection.to_str().unwrap().ends_with(".connection"));
    plant(connection);
    publish(&bus, sequence);
    let start = Instant::now();
    let mut tap = Tap::open(&run, 0, Topic::Raw, Duration::ZERO).unwrap();
    assert!(start.elapsed() < SOON, "{:?}", start.elapsed());
    assert!(!connection.exists());
    publish(&bus, sequence);
    assert!(frame(&mut tap, SOON).is_some());
}

#[test]
fn a_hundred_killed_buses_are_swept_in_no_time() {
    let Some(base) = own_base("killed::a_hundred_killed_buses_are_swept_in_no_time") else { return };
    let other = unique("other");
    let bus = Bus::create(&other, 0, WIDTH, HEIGHT).unwrap();
    let run = unique("many");
    for number in 0..10 {
        Peer::start("many", &format!("{run}-{number}")).kill();
    }
    let dead: Vec<_> = roots(&base).into_iter().filter(|root| root != bus.root()).collect();
    assert_eq!(dead.len(), 100);
    assert!(dead.iter().all(|root| shared_memory(root).len() > 8));
    assert_eq!(quick("sweeping one run", || sweep_run(&format!("{run}-3")).unwrap()), 10);
    // Two at the same time share the work.
    let removed = quick("sweeping all", || {
        std::thread::scope(|scope| {
            let both = [scope.spawn(sweep), scope.spawn(sweep)];
            both.map(|thread| thread.join().unwrap().unwrap()).iter().sum::<usize>()
        })
    });
    assert_eq!(removed, 90);
    assert!(dead.iter().all(|root| shared_memory(root).is_empty()));
    assert_eq!(roots(&base), [bus.root()]);
    assert_eq!(sweep().unwrap(), 0);
    publish(&bus, 0);
}

#[test]
fn sweeping_does_not_disturb_buses_that_come_and_go() {
    let Some(base) = own_base("killed::sweeping_does_not_disturb_buses_that_come_and_go") else { return };
    let run = unique("swept");
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while !is_over.load(Ordering::Relaxed) {
                    sweep().unwrap();
                }
            });
        }
        let makers: Vec<_> = (0..4)
            .map(|slot| {
                let run = &run;
                scope.spawn(move || {
                    for sequence in 0..30 {
                        let bus = Bus::create(run, slot, WIDTH, HEIGHT).unwrap();
                        let mut tap = Tap::open(run, slot, Topic::Raw, SECOND).unwrap();
                        publish(&bus, sequence);
                        assert!(is_intact(run, sequence, &frame(&mut tap, SOON).expect("a frame")));
                        assert!(shared_memory(bus.root()).len() > 8);
                    }
                })
            })
            .collect();
        let results: Vec<_> = makers.into_iter().map(|maker| maker.join()).collect();
        is_over.store(true, Ordering::Relaxed);
        assert!(results.iter().all(Result::is_ok));
    });
    sweep().unwrap();
    assert_eq!(roots(&base).len(), 0);
}

#[test]
fn a_process_takes_its_bus_along_when_a_thread_is_stuck_in_it() {
    let Some(base) = own_base("killed::a_process_takes_its_bus_along_when_a_thread_is_stuck_in_it") else {
        return;
    };
    let run = unique("stuck");
    for _ in 0..5 {
        let stuck = Peer::start("stuck", &run);
        let [root] = roots(&base).try_into().unwrap();
        let mut tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
        assert!(frame(&mut tap, SOON).is_some());
        stuck.end();
        assert!(!root.exists());
        assert!(shared_memory(&root).is_empty(), "{:?}", shared_memory(&root));
        assert!(tap.is_over().unwrap());
        while frame(&mut tap, Duration::ZERO).is_some() {}
    }
    let living = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
    for not_a_root in [base.as_path(), living.root().parent().unwrap(), Path::new("/")] {
        let error = remove(not_a_root).unwrap_err();
        assert!(error.message().contains("is not the root of a bus"), "{error}");
    }
    let root = living.root().to_owned();
    remove(&root).unwrap();
    remove(&root).unwrap();
    publish(&living, 0);
    drop(living);
    assert!(shared_memory(&root).is_empty());
}

#[test]
fn a_killed_publisher_leaves_nothing_in_the_way_of_the_next() {
    let Some(base) = own_base("killed::a_killed_publisher_leaves_nothing_in_the_way_of_the_next") else {
        return;
    };
    let run = unique("killed");
    for round in 0..4 {
        let mut publisher = Peer::start("publisher", &run);
        let mut tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
        publisher.command("5");
        assert!(!tap.is_over().unwrap());
        assert!(Tap::list().unwrap().iter().any(|found| found.run == run && found.slots.len() == 1));
        publisher.kill();

        assert!(tap.is_over().unwrap(), "round {round}");
        assert!(Tap::list().unwrap().iter().all(|found| found.run != run));
        if round % 2 == 0 {
            assert_eq!(sweep_run(&run), Ok(1));
            assert_eq!(roots(&base).len(), 0);
        }
        // In two rounds the tap is gone when the next publisher comes, in two it lives on.
        let mut next = (round > 1).then(|| Peer::start("publisher", &run));
        // The frames that were on their way are still readable.
        for sequence in 0..5 {
            assert!(is_intact(&run, sequence, &frame(&mut tap, SECOND).expect("a frame")), "round {round}");
        }
        if let Some(next) = &mut next {
            let deadline = Instant::now() + SOON;
            let mut seen = None;
            while seen.is_none() && Instant::now() < deadline {
                next.command("1");
                seen = frame(&mut tap, Duration::from_millis(30));
            }
            let seen = seen.expect("a frame of the next publisher");
            assert!(is_intact(&run, seen.header().sequence, &seen));
            assert_eq!(tap.lost(), 0);
        }
        drop(next);
        sweep().unwrap();
    }
}

#[test]
fn killed_taps_do_not_wear_the_loop_down() {
    let Some(_) = own_base("killed::killed_taps_do_not_wear_the_loop_down") else { return };
    let run = unique("taps");
    let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
    let mut sequence = 0;
    let mut publish_some = |count: u64| {
        (0..count).for_each(|_| {
            publish(&bus, sequence);
            sequence += 1;
        });
    };
    // More than there are places for taps, each killed while it holds frames.
    for _ in 0..12 {
        let mut holder = Peer::start("holder", &run);
        publish_some(3);
        holder.command("hold");
        publish_some(30);
        holder.kill();
        publish_some(30);
    }
    let mut tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
    publish_some(1);
    assert!(frame(&mut tap, SOON).is_some());

    // One that is killed when the bus is gone already.
    let mut holder = Peer::start("holder", &run);
    publish_some(3);
    holder.command("hold");
    drop(bus);
    holder.kill();
}

#[test]
fn sweeping_spares_the_living() {
    let Some(_) = own_base("killed::sweeping_spares_the_living") else { return };
    let run = unique("living");
    // It has looked at itself, which must not make it look dead to others.
    let mut watcher = Peer::start("watcher", &run);
    let root = Tap::list().unwrap()[0].slots[0].root.clone();
    let files = shared_memory(&root);
    assert!(files.len() > 8, "{files:?}");
    for _ in 0..3 {
        assert_eq!(sweep(), Ok(0));
        Peer::start("sweeper", &run).end();
    }
    assert_eq!(shared_memory(&root).len(), files.len());
    let mut tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
    watcher.command("1");
    assert!(is_intact(&run, 0, &frame(&mut tap, SOON).expect("a frame")));
    watcher.kill();
    assert_eq!(sweep(), Ok(1));
}

#[test]
fn ended_runs_leave_no_files() {
    let Some(base) = own_base("killed::ended_runs_leave_no_files") else { return };
    for round in 0..50 {
        let bus = Bus::create(&unique(&format!("short-{round}")), 0, WIDTH, HEIGHT).unwrap();
        let mut tap = Tap::open(bus.run(), 0, Topic::Raw, SOON).unwrap();
        publish(&bus, 0);
        assert!(frame(&mut tap, SOON).is_some());
        let root = bus.root().to_owned();
        assert!(shared_memory(&root).len() > 8);
        drop(bus);
        assert!(shared_memory(&root).is_empty() && roots(&base).is_empty());
        drop(tap);
        assert!(shared_memory(&root).is_empty() && roots(&base).is_empty());
    }
    // iceoryx2's paths have an end; where it is, nothing is left either.
    let error = Bus::create(&"x".repeat(64), u32::MAX, WIDTH, HEIGHT).unwrap_err();
    assert!(error.message().contains("too long"), "{error}");
    Bus::create(&"x".repeat(30), u32::MAX, WIDTH, HEIGHT).unwrap();
}

#[test]
fn everything_is_this_users_alone() {
    let Some(base) = own_base("killed::everything_is_this_users_alone") else { return };
    let bus = Bus::create(&unique("private"), 0, WIDTH, HEIGHT).unwrap();
    let mut tap = Tap::open(bus.run(), 0, Topic::Raw, SOON).unwrap();
    publish(&bus, 0);
    assert!(frame(&mut tap, SOON).is_some());
    for folder in [&base, bus.root().parent().unwrap(), bus.root()] {
        assert_eq!(fs::metadata(folder).unwrap().mode() & 0o7777, 0o700, "{folder:?}");
    }
    let memory = shared_memory(bus.root());
    assert!(memory.iter().any(|file| file.to_str().unwrap().ends_with(".global_mgmt")), "{memory:?}");
    for file in memory {
        assert_eq!(fs::metadata(&file).unwrap().mode() & 0o077, 0, "{file:?}");
    }

    // A base that leads elsewhere is not followed.
    let link = base.with_extension("link");
    symlink(&base, &link).unwrap();
    Peer::start_with("refused", bus.run(), &[(BASE_VARIABLE, &link)]).end();
    fs::remove_file(link).unwrap();
    fs::set_permissions(&base, fs::Permissions::from_mode(0o777)).unwrap();
    let error = sweep().unwrap_err();
    assert!(error.message().contains("can be written by other users"), "{error}");
    fs::set_permissions(&base, fs::Permissions::from_mode(0o700)).unwrap();
}
