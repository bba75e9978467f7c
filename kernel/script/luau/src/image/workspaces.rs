//! What operations on images keep between calls, one set for each virtual machine. It lies outside of the machine's
//! memory.

use mlua::Lua;
use pdk_sdk::ops::{
    Frame, FrameBuf, average, canny, elastic, equalise, gaussian, jpeg, low_pass, perspective, phase,
    poisson, resample, resize, scatter, sharpen, unsharp, warp, zoom,
};

/// The workspaces of the kernels, each made when it is first needed.
#[derive(Default)]
pub struct Workspaces {
    /// The pixels of an image before they are changed.
    pub(super) before: FrameBuf,
    /// A mask, as large as the image.
    mask: FrameBuf,
    /// A small copy of an image.
    pub small: FrameBuf,
    /// A row of pixels.
    pub row: Vec<u8>,
    /// For [`average`].
    pub average: average::Workspace,
    /// For [`canny`].
    pub canny: canny::Workspace,
    /// For [`elastic`].
    pub elastic: elastic::Workspace,
    /// For [`equalise`].
    pub equalise: equalise::Workspace,
    /// For [`gaussian`].
    pub gaussian: gaussian::Workspace,
    /// For [`jpeg`].
    pub jpeg: jpeg::Workspace,
    /// For [`low_pass`].
    pub low_pass: low_pass::Workspace,
    /// For [`perspective`].
    pub perspective: perspective::Workspace,
    /// For [`phase`].
    pub phase: phase::Workspace,
    /// For [`poisson`]: the tables of the last expected count.
    pub poisson: Option<poisson::PoissonTable>,
    /// For [`resample`].
    pub resample: resample::Workspace,
    /// For [`scatter`].
    pub scatter: scatter::Workspace,
    /// For [`sharpen`].
    pub sharpen: sharpen::Workspace,
    /// For [`unsharp`].
    pub unsharp: unsharp::Workspace,
    /// For [`warp`].
    pub warp: warp::Workspace,
    /// For [`zoom`].
    pub zoom: zoom::Workspace,
}

impl Workspaces {
    /// Does work with the workspaces of a virtual machine.
    pub(super) fn lend<R>(
        lua: &Lua,
        work: impl FnOnce(&mut Workspaces) -> mlua::Result<R>,
    ) -> mlua::Result<R> {
        if lua.app_data_ref::<Workspaces>().is_none() {
            lua.set_app_data(Workspaces::default());
        }
        let mut workspaces = lua
            .app_data_mut::<Workspaces>()
            .ok_or_else(|| mlua::Error::runtime("the workspaces of this script are in use"))?;
        work(&mut workspaces)
    }

    /// A mask as large as `image`, stretched if it is smaller or larger, and a row of pixels.
    pub fn mask_for<'a>(&'a mut self, image: Frame<'_>, mask: Frame<'a>) -> (Frame<'a>, &'a mut Vec<u8>) {
        if image.same_size(&mask) {
            return (mask, &mut self.row);
        }
        self.mask.resize(image.width(), image.height());
        resize::resize_linear(mask, self.mask.as_mut());
        (self.mask.as_ref(), &mut self.row)
    }
}
