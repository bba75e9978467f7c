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
/// The kinds are `perturbations`, `simulators`, `drivers`, `saliencies`, `searches` and `datasets`. The crate has to be
/// a `cdylib`, and may use the macro once.
#[macro_export]
macro_rules! export {
    ($($kind:ident: [$($component:ty),* $(,)?]),* $(,)?) => {
        const _: () = {
            use $crate::abi::abi_stable;
            use abi_stable::std_types::{RStr, RString};

            static TABLE: &[$crate::abi::plugin::Registration] =
                &[$($($crate::abi::plugin::$kind::<$component>()),*),*];

            extern "C" fn describe() -> $crate::abi::Outcome<RString> {
                $crate::abi::plugin::describe(env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"), TABLE)
            }

            extern "C" fn create(
                index: usize,
                config: RStr<'_>,
            ) -> $crate::abi::Outcome<$crate::abi::RawComponent> {
                $crate::abi::plugin::create(TABLE, index, config)
            }

            fn module() -> $crate::abi::PluginModuleRef {
                $crate::abi::plugin::module(describe, create)
            }

            extern "C" fn erased_module() -> abi_stable::library::RootModuleResult {
                abi_stable::library::__call_root_module_loader(module)
            }

            // SAFETY: the names are part of the interface and no other crate in a plugin uses them.
            #[unsafe(no_mangle)]
            #[allow(non_upper_case_globals)]
            pub static pdk_plugin: abi_stable::library::LibHeader =
                // SAFETY: `module` returns the root module whose type is named here.
                unsafe {
                    abi_stable::library::LibHeader::from_constructor::<$crate::abi::PluginModuleRef>(
                        erased_module,
                        abi_stable::library::CheckTypeLayout::Yes,
                    )
                };

            // SAFETY: as above.
            #[unsafe(no_mangle)]
            pub extern "C" fn pdk_plugin_sdk_version() -> *const ::std::ffi::c_char {
                $crate::abi::plugin::SDK_VERSION.as_ptr()
            }
        };
    };
}
