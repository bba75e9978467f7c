//! The class of this machine's processor: which instructions a library that picks its kernels by the processor may use.

/// The class by the levels of the x86-64 psABI (`x86-64`, `x86-64-v2`, `x86-64-v3`, `x86-64-v4`), with the extensions beyond them that
/// libraries of networks use; elsewhere the architecture.
pub fn class() -> String {
    #[cfg(target_arch = "x86_64")]
    return x86_64();
    #[cfg(not(target_arch = "x86_64"))]
    return std::env::consts::ARCH.to_owned();
}

/// Whether the processor has what level 3 of x86-64 has of vector instructions.
pub fn is_v3() -> bool {
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("f16c");
    #[cfg(not(target_arch = "x86_64"))]
    return false;
}

#[cfg(target_arch = "x86_64")]
fn x86_64() -> String {
    let v4 = is_v3()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512cd")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl");
    let v2 = is_x86_feature_detected!("sse4.2") && is_x86_feature_detected!("popcnt");
    let level = if v4 {
        "x86-64-v4"
    } else if is_v3() {
        "x86-64-v3"
    } else if v2 {
        "x86-64-v2"
    } else {
        "x86-64"
    };
    let leaf = |leaf, subleaf| {
        // The largest leaf that the processor answers.
        let known = std::arch::x86_64::__cpuid(0).eax >= leaf;
        known.then(|| std::arch::x86_64::__cpuid_count(leaf, subleaf))
    };
    // Bits of Intel's Software Developer's Manual, volume 2A, CPUID.
    let (features, more) = (leaf(7, 0).map_or(0, |found| found.edx), leaf(7, 1));
    let (more_a, more_d) = more.map_or((0, 0), |found| (found.eax, found.edx));
    let extensions = [
        ("avx512_vnni", is_x86_feature_detected!("avx512vnni")),
        ("avx512_bf16", more_a & 1 << 5 != 0),
        ("avx512_fp16", features & 1 << 23 != 0),
        ("avx_vnni", more_a & 1 << 4 != 0),
        ("avx_vnni_int8", more_d & 1 << 4 != 0),
        ("avx_ne_convert", more_d & 1 << 5 != 0),
        ("amx_bf16", features & 1 << 22 != 0),
        ("amx_int8", features & 1 << 25 != 0),
    ];
    let mut class = level.to_owned();
    for (name, _) in extensions.into_iter().filter(|(_, has)| *has) {
        class.push('+');
        class.push_str(name);
    }
    class
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_class_begins_with_the_architecture() {
        let class = super::class();
        assert!(class.starts_with(&std::env::consts::ARCH.replace('_', "-")), "{class}");
        if cfg!(target_arch = "x86_64") {
            let level = class.split('+').next().unwrap();
            assert_eq!(super::is_v3(), matches!(level, "x86-64-v3" | "x86-64-v4"), "{class}");
        }
    }
}
