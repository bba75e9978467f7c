//! The macro that turns a crate into a plugin.

/// Makes the crate a plugin that carries the listed components, by kind:
///
/// ```ignore
/// pdk_sdk::export! {
///     perturbations: [GaussianNoise, PoissonNoise],
///     drivers: [Onnx],
/// }
/// ```
///
/// The kinds are `perturbations`, `simulators`, `drivers`, `saliencies`, `masks`, `searches` and `datasets`. The crate has to be
/// a `cdylib`, and may use the macro once. Name and version of the plugin are those of the package, and its `homepage` or
/// `repository` is where pdk says that the plugin is to be had.
#[macro_export]
macro_rules! export {
    ($($kind:ident: [$($component:ty),* $(,)?]),* $(,)?) => {
        const _: () = {
            use $crate::abi::pdk_abi::{Header, Instance, Plugin, Sink, Status, Text, VERSION};
            use $crate::abi::plugin::{Package, Registration};

            static PACKAGE: Package = Package {
                name: env!("CARGO_PKG_NAME"),
                version: env!("CARGO_PKG_VERSION"),
                homepage: env!("CARGO_PKG_HOMEPAGE"),
                repository: env!("CARGO_PKG_REPOSITORY"),
            };

            static TABLE: &[Registration] = &[$($($crate::abi::plugin::$kind::<$component>()),*),*];

            unsafe extern "C" fn describe(description: *const Sink, error: *const Sink) -> Status {
                // SAFETY: the host lends both for this call.
                unsafe { $crate::abi::plugin::describe(&PACKAGE, TABLE, description, error) }
            }

            unsafe extern "C" fn create(
                index: usize,
                parameters: Text,
                into: *mut Instance,
                error: *const Sink,
            ) -> Status {
                // SAFETY: the host lends all of it for this call.
                unsafe { $crate::abi::plugin::create(TABLE, index, parameters, into, error) }
            }

            unsafe extern "C" fn input_files(
                index: usize,
                parameters: Text,
                files: *const Sink,
                error: *const Sink,
            ) -> Status {
                // SAFETY: the host lends all of it for this call.
                unsafe { $crate::abi::plugin::input_files(TABLE, index, parameters, files, error) }
            }

            // SAFETY: the name is part of the interface and no other crate in a plugin uses it.
            #[unsafe(no_mangle)]
            #[allow(non_upper_case_globals)]
            pub static pdk_plugin: Header = Header {
                version: VERSION,
                plugin: &Plugin {
                    size: ::core::mem::size_of::<Plugin>(),
                    describe: Some(describe),
                    create: Some(create),
                    input_files: Some(input_files),
                },
            };
        };
    };
}
