//! Earlier frames, as a script sees them in `cx.history`.

use mlua::{AnyUserData, Lua, Table};
use pdk_sdk::history::History;
use pdk_sdk::signals::Signals;

use crate::image::LuaImage;
use crate::signals::ScriptSignal;

/// The list `cx.history` with its entries, which are used again for every frame.
pub struct ScriptHistory {
    list: Table,
    entries: Vec<(Table, AnyUserData)>,
    /// Entries of signals, each with what was given and what was passed on.
    signals: Vec<[Table; 3]>,
}

impl ScriptHistory {
    /// Puts an empty list into the context.
    ///
    /// # Errors
    /// If the script is out of memory.
    pub fn new(lua: &Lua, context: &Table) -> mlua::Result<Self> {
        let list = lua.create_table()?;
        context.raw_set("history", &list)?;
        Ok(Self { list, entries: Vec::new(), signals: Vec::new() })
    }

    /// Makes the list that of another frame. Scripts may change the images, which are copies.
    ///
    /// # Errors
    /// If the script is out of memory.
    pub fn set(&mut self, lua: &Lua, history: &History<'_>) -> mlua::Result<()> {
        self.list.clear()?;
        for (place, earlier) in history.iter().enumerate() {
            let (width, height) = (earlier.frame.width(), earlier.frame.height());
            let fits = self.entries.get(place).map(|(_, image)| {
                let image = image.borrow::<LuaImage>()?;
                mlua::Result::Ok((image.width(), image.height()) == (width, height))
            });
            if !fits.transpose()?.unwrap_or(false) {
                self.entries.truncate(place);
                let image = lua.create_userdata(LuaImage::for_frames(lua, width, height)?)?;
                self.entries.push((lua.create_table()?, image));
            }
            let (entry, image) = &self.entries[place];
            image.borrow_mut::<LuaImage>()?.frame_mut()?.copy_from(earlier.frame);
            entry.clear()?;
            entry.raw_set("image", image)?;
            entry.raw_set("frame_index", earlier.frame_index as f64)?;
            entry.raw_set("time", earlier.time)?;
            self.list.raw_set(place + 1, entry)?;
        }
        Ok(())
    }
}

impl ScriptHistory {
    /// Makes the list that of the signals before another frame. Scripts may change the tables, which are written anew.
    ///
    /// # Errors
    /// If the script is out of memory.
    pub fn set_signals(
        &mut self,
        lua: &Lua,
        signals: &Signals<'_>,
        shape: &ScriptSignal,
    ) -> mlua::Result<()> {
        self.list.clear()?;
        for (place, signal) in signals.iter().enumerate() {
            if place == self.signals.len() {
                self.signals.push([lua.create_table()?, lua.create_table()?, lua.create_table()?]);
            }
            let [entry, given, passed] = &self.signals[place];
            entry.clear()?;
            for (name, table, numbers) in [("given", given, signal.given), ("passed", passed, signal.passed)]
            {
                table.clear()?;
                shape.write(table, numbers)?;
                entry.raw_set(name, table)?;
            }
            entry.raw_set("frame_index", signal.frame_index as f64)?;
            entry.raw_set("time", signal.time)?;
            self.list.raw_set(place + 1, entry)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::config::Config;
    use pdk_sdk::history::Recollection;
    use pdk_sdk::ops::FrameBuf;
    use pdk_sdk::perturbation::{Context, Perturbation, Way};
    use pdk_sdk::serde_json::json;

    use crate::limits::Limits;
    use crate::perturbation::LuaPerturbation;
    use crate::perturbation::tests::{key, make, picture, run};

    #[test]
    fn a_script_sees_the_frames_that_it_asks_for() {
        let source = "return { doc = 'The oldest frame', history = 3, apply = function(image, cx)
            local oldest = cx.history[#cx.history]
            if oldest then
                assert(oldest.frame_index == cx.frame_index - #cx.history and oldest.time == oldest.frame_index / 20)
                image:blend(oldest.image, 1)
                -- What is done to a copy stays in this frame.
                oldest.image:fill(0, 0, 0)
            end
        end }";
        let mut script = make(source, json!({})).unwrap();
        assert_eq!(script.description().history, 3);
        let (mut kept, key) = (Recollection::of(3), key());
        let frames: Vec<FrameBuf> = (0..6u8)
            .map(|number| {
                let mut frame = picture(20, 10);
                frame.as_mut().rows_mut().flatten().for_each(|value| *value = value.wrapping_add(number));
                frame
            })
            .collect();
        for (index, frame) in frames.iter().enumerate() {
            let time = index as f64 / 20.0;
            let history = kept.before(frame.as_ref(), index as u64);
            let cx = Context::new(2.0, index as u64, time, &key).with_history(history);
            assert_eq!(
                run(&mut script, frame, &cx).unwrap(),
                frames[index.saturating_sub(3)],
                "frame {index}"
            );
            kept.keep(frame.as_ref(), index as u64, time);
        }
    }

    #[test]
    fn points_are_moved_while_the_history_is_kept() {
        let source = "return { doc = 'x', geometry = 'moved', history = 8, move_point = function(x, y) return x + 1, y end,
            apply = function(image, cx) end }";
        let limits = Limits { memory_bytes: 4 << 20, ..Limits::default() };
        let mut script =
            LuaPerturbation::new("s.lua", source.as_bytes(), "s", Config::default(), limits).unwrap();
        let (mut kept, key, frame) = (Recollection::of(8), key(), FrameBuf::new(1000, 800));
        for index in 0..9 {
            let history = kept.before(frame.as_ref(), index);
            let cx = Context::new(2.0, index, 0.0, &key).with_history(history);
            run(&mut script, &frame, &cx).unwrap();
            let mut points = [[1.0, 2.0]];
            script.move_points(&mut points, Way::ToPerturbed, [1000, 800], &cx).unwrap();
            assert_eq!(points, [[2.0, 2.0]]);
            kept.keep(frame.as_ref(), index, 0.0);
        }
    }

    #[test]
    fn a_history_that_cannot_be_had_is_refused() {
        let refused = |fields: &str| {
            make(&format!("return {{ doc = 'x', {fields} }}"), json!({})).err().unwrap().to_string()
        };
        for wrong in ["-1", "2.5", "241", "'all'"] {
            let error = refused(&format!("history = {wrong}, apply = function() end"));
            assert!(error.contains("`history`"), "{error}");
        }
        assert!(refused("history = 1, mask = function() end").contains("leave `history` out"));
    }
}
