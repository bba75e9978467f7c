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
/// The names are the plurals of the [kinds](crate::describe::Kind), such as `saliencies` and `searches`. The crate has to be a
/// `cdylib`, and may use the macro once. Name and version of the plugin are those of the package, and its `homepage` or
/// `repository` is where pdk says that the plugin is to be had.
#[macro_export]
macro_rules! export {
    ($($kind:ident: [$($component:ty),* $(,)?]),* $(,)?) => {
        const _: () = {
            use $crate::abi::plugin::{Exported, LibHeader, Package, Registration, header};

            struct Components;

            impl Exported for Components {
                const PACKAGE: Package = Package {
                    name: env!("CARGO_PKG_NAME"),
                    version: env!("CARGO_PKG_VERSION"),
                    homepage: env!("CARGO_PKG_HOMEPAGE"),
                    repository: env!("CARGO_PKG_REPOSITORY"),
                };

                const TABLE: &'static [Registration] = &[$($($crate::abi::plugin::$kind::<$component>()),*),*];
            }

            // What `abi_stable::export_root_module` writes, which this edition of Rust does not take.
            // SAFETY: the name is that of abi_stable's header, and no other crate in a plugin uses it.
            #[unsafe(no_mangle)]
            #[allow(non_upper_case_globals)]
            pub static _1as_0lib_1header_0root_bmodule_bloader: LibHeader = header::<Components>();
        };
    };
}
