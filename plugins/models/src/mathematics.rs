//! The mathematical functions of this library, under the names by which compiled code asks for them.
//!
//! tract computes `exp`, `tan`, `pow` and the like with the functions of the standard library, which takes them from the system's
//! mathematical library. Their last digits differ between versions of that library, and between processors. Code in this library finds
//! the functions below instead (`build.rs` sees to that), so that a network computes the same everywhere.

/// Defines functions under the names of the C standard (ISO C, 7.12).
macro_rules! functions {
    ($type:ty: $($name:ident($($argument:ident),*)),* $(,)?) => {
        $(
            // SAFETY: the function does what the C standard asks of this name, so that a caller gets what it expects.
            #[unsafe(no_mangle)]
            extern "C" fn $name($($argument: $type),*) -> $type {
                libm::$name($($argument),*)
            }
        )*
    };
}

functions! { f64:
    acos(x), acosh(x), asin(x), asinh(x), atan(x), atan2(y, x), atanh(x), cbrt(x), cos(x), cosh(x), erf(x), erfc(x), exp(x), exp10(x),
    exp2(x), expm1(x), hypot(x, y), lgamma(x), log(x), log10(x), log1p(x), log2(x), pow(x, y), sin(x), sinh(x), tan(x), tanh(x),
    tgamma(x),
}

functions! { f32:
    acosf(x), acoshf(x), asinf(x), asinhf(x), atanf(x), atan2f(y, x), atanhf(x), cbrtf(x), cosf(x), coshf(x), erff(x), erfcf(x), expf(x),
    exp10f(x), exp2f(x), expm1f(x), hypotf(x, y), lgammaf(x), logf(x), log10f(x), log1pf(x), log2f(x), powf(x, y), sinf(x), sinhf(x),
    tanf(x), tanhf(x), tgammaf(x),
}

/// Defines functions that compute the sine and the cosine at once, which compilers call where code asks for both (a GNU extension).
macro_rules! both {
    ($type:ty: $name:ident = $sine:ident, $cosine:ident) => {
        // SAFETY: the function does what the GNU C library says of this name, so that a caller gets what it expects.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $name(x: $type, sine: *mut $type, cosine: *mut $type) {
            // SAFETY: the caller gives two places that can be written to, as that library demands.
            unsafe {
                sine.write(libm::$sine(x));
                cosine.write(libm::$cosine(x));
            }
        }
    };
}

both! { f64: sincos = sin, cos }
both! { f32: sincosf = sinf, cosf }

#[cfg(test)]
mod tests {
    // These are the calls that tract makes.
    #[expect(clippy::disallowed_methods)]
    /// The standard library's functions, called in a way that the compiler cannot compute beforehand.
    #[test]
    fn code_of_this_library_finds_these_functions() {
        use std::hint::black_box;
        let values = (1..2_000u32).map(|i| black_box(f64::from(i) * 0.037 - 30.0));
        for x in values {
            let y = x as f32;
            assert_eq!(x.exp().to_bits(), libm::exp(x).to_bits(), "exp({x})");
            assert_eq!(y.exp().to_bits(), libm::expf(y).to_bits(), "expf({y})");
            assert_eq!(x.sin_cos().0.to_bits(), libm::sin(x).to_bits(), "the sine of sincos({x})");
            assert_eq!(x.sin_cos().1.to_bits(), libm::cos(x).to_bits(), "the cosine of sincos({x})");
            assert_eq!(y.sin().to_bits(), libm::sinf(y).to_bits(), "sinf({y})");
            assert_eq!(y.tan().to_bits(), libm::tanf(y).to_bits(), "tanf({y})");
            assert_eq!(x.abs().ln().to_bits(), libm::log(x.abs()).to_bits(), "log({x})");
            assert_eq!(y.abs().powf(1.7).to_bits(), libm::powf(y.abs(), 1.7).to_bits(), "powf({y})");
        }
    }
}
