//! Looks at a library before the system maps it: from a file that was cut off, the system reads memory that is not
//! there, and in a damaged one it writes where others keep theirs.

use std::fs::File;
use std::path::Path;

use object::elf::{
    DT_JMPREL, DT_PLTRELSZ, DT_RELA, DT_RELASZ, DT_TEXTREL, EM_AARCH64, EM_X86_64, FileHeader64, PF_W,
    PT_LOAD, ProgramHeader64, R_AARCH64_RELATIVE, R_X86_64_RELATIVE, Rela64,
};
use object::read::elf::{Dyn, FileHeader, ProgramHeader, Rela};
use object::{Endianness, ReadCache, ReadRef};
use pdk_sdk::error::Result;
use pdk_sdk::file;

/// How many bytes the file has to have and how many it has, if it has too few. Only 64-bit ELF files are looked at;
/// everything else is left to the system.
///
/// # Errors
/// If the file cannot be read.
pub fn missing_part(path: &Path) -> Result<Option<(u64, u64)>> {
    let (file, has) = file::open(path)?;
    let needed = needed(&ReadCache::new(file)).unwrap_or(0);
    Ok((needed > has).then_some((needed, has)))
}

/// The bytes up to the end of the last part that is mapped, or of the table that says what is.
fn needed<'data>(data: impl ReadRef<'data>) -> object::Result<u64> {
    let header = FileHeader64::<Endianness>::parse(data)?;
    let endian = header.endian()?;
    let size = u64::from(header.e_phentsize(endian)) * u64::from(header.e_phnum(endian));
    let table = header.e_phoff(endian).saturating_add(size);
    let Ok(programs) = header.program_headers(endian, data) else { return Ok(table) };
    let ends = loaded(programs, endian).map(|program| {
        let (at, length) = program.file_range(endian);
        at.saturating_add(length)
    });
    Ok(ends.max().unwrap_or(0).max(table))
}

/// Whether a library asks the system to change memory outside of what it keeps for itself. What is found there differs from
/// process to process, so such a library may crash one and not the other.
///
/// # Errors
/// If the file cannot be read.
pub fn strays(path: &Path) -> Result<bool> {
    let (file, _) = file::open(path)?;
    // What cannot be followed cannot be loaded either, and the system says why.
    Ok(relocates_others(&ReadCache::<File>::new(file)).unwrap_or(false))
}

fn relocates_others<'data>(data: impl ReadRef<'data>) -> object::Result<bool> {
    let header = FileHeader64::<Endianness>::parse(data)?;
    let endian = header.endian()?;
    let programs = header.program_headers(endian, data)?;
    let relative = match header.e_machine(endian) {
        EM_X86_64 => R_X86_64_RELATIVE,
        EM_AARCH64 => R_AARCH64_RELATIVE,
        _ => return Ok(false),
    };
    let mut tags =
        [(DT_RELA, None), (DT_RELASZ, None), (DT_JMPREL, None), (DT_PLTRELSZ, None), (DT_TEXTREL, None)];
    for program in programs {
        for entry in program.dynamic(endian, data)?.unwrap_or_default() {
            let known = tags.iter_mut().find(|(tag, _)| entry.tag(endian) == *tag);
            if let Some((_, value)) = known {
                *value = Some(entry.val(endian));
            }
        }
    }
    let [(_, table), (_, size), (_, calls), (_, calls_size), (_, in_code)] = tags;
    let within = |address: u64, length: u64, writable: bool| {
        loaded(programs, endian).any(|program| {
            let (from, size) = (program.p_vaddr(endian), program.p_memsz(endian));
            let allowed = !writable || in_code.is_some() || program.p_flags(endian).contains(PF_W);
            allowed && address >= from && address.saturating_add(length) <= from.saturating_add(size)
        })
    };
    for (address, size) in [table.zip(size), calls.zip(calls_size)].into_iter().flatten() {
        let bytes = loaded(programs, endian)
            .find_map(|program| program.data_range(endian, data, address, size).ok().flatten())
            .unwrap_or_default();
        let (relocations, _) = object::pod::slice_from_bytes::<Rela64<Endianness>>(
            bytes,
            bytes.len() / size_of::<Rela64<Endianness>>(),
        )
        .unwrap_or_default();
        for relocation in relocations {
            let points_in = || within(relocation.r_addend(endian) as u64, 0, false);
            if !within(relocation.r_offset(endian), 8, true)
                || relocation.r_type(endian, false) == relative && !points_in()
            {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

fn loaded(
    programs: &[ProgramHeader64<Endianness>],
    endian: Endianness,
) -> impl Iterator<Item = &ProgramHeader64<Endianness>> {
    programs.iter().filter(move |program| program.p_type(endian) == PT_LOAD)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_executable_is_complete_and_its_first_half_is_not() {
        let whole = std::env::current_exe().unwrap();
        assert_eq!(missing_part(&whole).unwrap(), None);
        let bytes = std::fs::read(&whole).unwrap();
        assert_eq!(&bytes[..5], b"\x7fELF\x02", "a 64-bit ELF file");
        let cut = std::env::temp_dir().join(format!("pdk-elf-{}", std::process::id()));
        for len in [64, 5_000] {
            std::fs::write(&cut, &bytes[..len]).unwrap();
            let (needed, has) = missing_part(&cut).unwrap().unwrap();
            assert!(needed > has && has == len as u64);
        }
        std::fs::write(&cut, "no library").unwrap();
        assert_eq!(missing_part(&cut).unwrap(), None);
        std::fs::remove_file(&cut).unwrap();
    }

    #[test]
    fn a_library_that_relocates_others_is_recognised() {
        let whole = std::env::current_exe().unwrap();
        assert!(!strays(&whole).unwrap());
        let mut bytes = std::fs::read(&whole).unwrap();
        let table = relocations(&bytes[..]).unwrap();
        let changed = std::env::temp_dir().join(format!("pdk-elf-stray-{}", std::process::id()));
        for field in [0, 16] {
            // The place that is changed, or what it is to point to.
            bytes[table + field + 6] ^= 0x5a;
            std::fs::write(&changed, &bytes).unwrap();
            assert!(strays(&changed).unwrap(), "field at {field}");
            bytes[table + field + 6] ^= 0x5a;
        }
        std::fs::write(&changed, &bytes).unwrap();
        assert!(!strays(&changed).unwrap());
        std::fs::remove_file(&changed).unwrap();
    }

    /// Where the table of relocations begins in a file.
    fn relocations(data: &[u8]) -> object::Result<usize> {
        let header = FileHeader64::<Endianness>::parse(data)?;
        let endian = header.endian()?;
        let programs = header.program_headers(endian, data)?;
        let dynamic = programs.iter().find_map(|program| program.dynamic(endian, data).unwrap()).unwrap();
        let address = dynamic.iter().find(|entry| entry.tag(endian) == DT_RELA).unwrap().val(endian);
        let part = loaded(programs, endian).find(|program| {
            (program.p_vaddr(endian)..program.p_vaddr(endian) + program.p_filesz(endian)).contains(&address)
        });
        let part = part.unwrap();
        Ok((address - part.p_vaddr(endian) + part.p_offset(endian)) as usize)
    }
}
