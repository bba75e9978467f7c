//! What a component can do to the whole process that it runs in, or to the thread.

use std::ffi::CStr;
use std::io::Write;

/// All that it can do.
pub const WAYS: [&str; 8] = [
    "eat_memory",
    "close_stdout",
    "block_signals",
    "change_directory",
    "change_locale",
    "change_rounding",
    "print_a_lot",
    "babble",
];

/// Those ways, after the `own` ones of a component.
pub fn and_ways<'a>(own: &[&'a str]) -> Vec<&'a str> {
    own.iter().copied().chain(WAYS).collect()
}

/// Memory is taken in pieces of this size, up to this many: 10 GB.
const PIECE: usize = 64 << 20;
const PIECES: usize = 160;
/// Each page of memory is written to, so that the system has to provide it.
const PAGE: usize = 4096;

/// Bytes that are printed to each stream.
const PRINTED: usize = 10 << 20;

/// Locales in which letters or numbers are not those of English; the last one is always there.
const LOCALES: [&CStr; 5] = [c"tr_TR.UTF-8", c"tr_TR", c"de_DE.UTF-8", c"C.UTF-8", c"POSIX"];

/// Does it, if `how` is one of the ways.
pub fn disturb(how: &str) {
    match how {
        "eat_memory" => eat_memory(),
        "close_stdout" => close_streams(),
        "block_signals" => block_signals(),
        "change_directory" => _ = std::env::set_current_dir("/"),
        "change_locale" => change_locale(),
        "change_rounding" => change_rounding(),
        "print_a_lot" => print_a_lot(),
        "babble" => babble(),
        _ => {}
    }
}

fn eat_memory() {
    let mut pieces = Vec::new();
    for _ in 0..PIECES {
        let mut piece = vec![0u8; PIECE];
        piece.iter_mut().step_by(PAGE).for_each(|byte| *byte = 1);
        // Or the compiler could see that it is not read.
        pieces.push(std::hint::black_box(piece));
    }
}

fn close_streams() {
    for stream in 0..3 {
        // SAFETY: touches no memory. Whoever uses the stream later gets an error, or the file that has its number by then:
        // that is what is asked for.
        unsafe { libc::close(stream) };
    }
}

fn block_signals() {
    // SAFETY: the set is filled before it is used, and nothing is asked for the one before.
    unsafe {
        let mut all = std::mem::zeroed();
        libc::sigfillset(&mut all);
        libc::pthread_sigmask(libc::SIG_BLOCK, &all, std::ptr::null_mut());
    }
}

fn change_locale() {
    for locale in LOCALES {
        // SAFETY: the name ends in NUL. Another thread that formats numbers meanwhile may see either locale, or worse: that is
        // what is asked for.
        if unsafe { !libc::setlocale(libc::LC_ALL, locale.as_ptr()).is_null() } {
            // SAFETY: both end in NUL, and are copied. As above for other threads, which may read the environment.
            unsafe { libc::setenv(c"LC_ALL".as_ptr(), locale.as_ptr(), 1) };
            return;
        }
    }
}

/// From now on this thread rounds towards zero, and numbers close to zero are zero.
#[cfg(target_arch = "x86_64")]
fn change_rounding() {
    // All exceptions masked as ever; bits 13 and 14 round towards zero, 15 and 6 flush numbers close to zero.
    let register: u32 = 0x1f80 | 0x6000 | 0x8000 | 0x0040;
    // SAFETY: reads four bytes and writes to a register of this thread. The compiler assumes another rounding: that this is
    // noticed is what is asked for.
    unsafe {
        std::arch::asm!("ldmxcsr [{}]", in(reg) &register, options(readonly, nostack, preserves_flags))
    };
}

/// From now on this thread rounds towards zero, and numbers close to zero are zero.
#[cfg(target_arch = "aarch64")]
fn change_rounding() {
    // Bits 22 and 23 round towards zero, bit 24 flushes numbers close to zero.
    let register: u64 = 0x01c0_0000;
    // SAFETY: writes to a register of this thread. The compiler assumes another rounding: that this is noticed is what is
    // asked for.
    unsafe { std::arch::asm!("msr fpcr, {}", in(reg) register, options(nomem, nostack, preserves_flags)) };
}

/// It is not written for this processor.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn change_rounding() {
    panic!("the rounding mode of this processor cannot be changed here; add the instruction in {}", file!());
}

fn print_a_lot() {
    let line = [b"a lot of words without a question ".repeat(27), b"\n".to_vec()].concat();
    for _ in 0..PRINTED / line.len() {
        // If no one listens, nothing can be reported.
        _ = std::io::stdout().write_all(&line);
        _ = std::io::stderr().write_all(&line);
    }
}

/// Writes something unreadable to every pipe of the process, and waits for what comes of that.
fn babble() {
    for file in 3..64 {
        // SAFETY: both write to memory of their own, and report it if there is no such file or it may not be written to.
        unsafe {
            let mut status = std::mem::zeroed::<libc::stat>();
            if libc::fstat(file, &raw mut status) == 0 && status.st_mode & libc::S_IFMT == libc::S_IFIFO {
                let line = b"\n{ what? }\n";
                _ = libc::write(file, line.as_ptr().cast(), line.len());
            }
        }
    }
    std::thread::sleep(std::time::Duration::from_secs(3600));
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    /// Tells the child what to do to itself.
    const WAY: &str = "MISBEHAVE_TEST_WAY";

    /// The path of a test of this module, as the program takes it: without the name of the program.
    fn path_of(test: &str) -> String {
        format!("{}::{test}", module_path!().split_once("::").unwrap().1)
    }

    /// A process that does this to itself, and then tells how it is.
    fn command(way: &str) -> Command {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", "--nocapture", &path_of("every_way_does_what_it_is_called")]);
        command.env(WAY, way).env_remove("LC_ALL");
        command
    }

    /// How this process is.
    fn told() -> String {
        // SAFETY: the set is written before it is read, and nothing is changed.
        let blocked = unsafe {
            let mut set = std::mem::zeroed();
            libc::pthread_sigmask(libc::SIG_BLOCK, std::ptr::null(), &mut set);
            libc::sigismember(&set, libc::SIGTERM) == 1
        };
        let folder = std::env::current_dir().unwrap();
        let locale = std::env::var("LC_ALL").unwrap_or_default();
        // A tenth as the processor computes it, not the compiler; rounding to nearest rounds it up.
        let tenth = std::hint::black_box(1.0f64) / std::hint::black_box(10.0f64);
        // A number close to zero.
        let tiny = std::hint::black_box(f64::MIN_POSITIVE) / std::hint::black_box(4.0f64);
        let (folder, tenth, tiny) = (folder.display(), tenth.to_bits(), tiny.to_bits());
        format!("blocked {blocked}, folder {folder}, locale {locale:?}, tenth {tenth:x}, tiny {tiny:x}")
    }

    #[test]
    fn memory_is_taken_until_there_is_none() {
        use std::os::unix::process::{CommandExt, ExitStatusExt};
        let mut command = command("eat_memory");
        let limit = libc::rlimit { rlim_cur: 2 << 30, rlim_max: 2 << 30 };
        // SAFETY: between fork and exec, this calls nothing but one function of the system.
        unsafe {
            command.pre_exec(move || match libc::setrlimit(libc::RLIMIT_AS, &limit) {
                0 => Ok(()),
                _ => Err(std::io::Error::last_os_error()),
            })
        };
        let output = command.output().unwrap();
        assert_eq!(output.status.signal(), Some(libc::SIGABRT), "{output:?}");
        assert!(
            String::from_utf8_lossy(&output.stderr).contains("memory allocation of 67108864 bytes failed")
        );
    }

    #[test]
    fn every_way_does_what_it_is_called() {
        if let Ok(way) = std::env::var(WAY) {
            disturb(&way);
            eprintln!("\n{}", told());
            return;
        }
        let after = |way| {
            let errors = command(way).output().unwrap().stderr;
            String::from_utf8(errors).unwrap().trim_end().lines().last().unwrap_or_default().to_owned()
        };
        let usual = after("behave");
        assert!(usual.starts_with("blocked false, folder /"), "{usual}");
        assert!(usual.ends_with(", locale \"\", tenth 3fb999999999999a, tiny 4000000000000"), "{usual}");
        assert_eq!(after("block_signals"), usual.replace("blocked false", "blocked true"));
        assert!(after("change_directory").starts_with("blocked false, folder /, "));
        assert!(!after("change_locale").contains("locale \"\""));
        assert_eq!(
            after("change_rounding"),
            usual.replace("tenth 3fb999999999999a, tiny 4000000000000", "tenth 3fb9999999999999, tiny 0")
        );
        assert!(!after("close_stdout").contains("blocked"));
        let printed = command("print_a_lot").output().unwrap();
        assert!(printed.stdout.len() > PRINTED - 2000 && printed.stderr.len() > PRINTED - 2000);
    }
}
