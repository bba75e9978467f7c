//! The archive. The same tree gives the same bytes.
//!
//! It is compressed with xz. The libraries have much code in common, which gzip does not look far enough back to find: of the 87 MB of a
//! build, gzip leaves 38 MB and xz 22.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use liblzma::write::XzEncoder;
use pdk_model::error::{Place, Result};
use tar::{Builder, Header, HeaderMode};
use walkdir::WalkDir;

use crate::Profile;
use crate::compile::GLIBC;
use crate::project::Project;

/// Packs the tree, and returns the archive.
///
/// # Errors
/// If a file cannot be read or written.
pub fn pack(project: &Project, tree: &Path, profile: Profile) -> Result<PathBuf> {
    let title = project.title()?;
    let path = project.out().join(format!("{title}.tar.xz"));
    // The highest level takes minutes, and archives to try do not have to be small.
    let level = if profile == Profile::Dist { 9 } else { 1 };
    let file = File::create(&path).place(path.display())?;
    let mut archive = Builder::new(XzEncoder::new(BufWriter::new(file), level));
    // Neither owners nor times.
    archive.mode(HeaderMode::Deterministic);
    let script = install_script(project)?;
    let mut header = Header::new_gnu();
    header.set_mode(0o755);
    header.set_size(script.len() as u64);
    archive.append_data(&mut header, format!("{title}/install"), script.as_bytes()).place(path.display())?;
    for entry in WalkDir::new(tree).sort_by_file_name() {
        let entry = entry.place(tree.display())?;
        let place = Path::new(&title).join(entry.path().strip_prefix(tree).place(tree.display())?);
        archive.append_path_with_name(entry.path(), place).place(entry.path().display())?;
    }
    let file = archive.into_inner().and_then(XzEncoder::finish).place(path.display())?;
    file.into_inner().place(path.display())?;
    Ok(path)
}

/// The script that links pdk into a folder of the PATH, and refuses systems that pdk does not run on.
fn install_script(project: &Project) -> Result<String> {
    let file = project.root().join("dist/install.sh");
    let template = std::fs::read_to_string(&file).place(file.display())?;
    Ok(template.replace("{{machine}}", project.target().machine()).replace("{{glibc}}", GLIBC))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;
    use std::process::{Command, Output};

    use super::*;
    use crate::project::Target;

    /// Runs the script with these programs in the place of the system's.
    fn install(folder: &Path, machine: &str, libc: &str) -> Output {
        let project = Project::for_target(Target::X86).unwrap();
        let write = |name: &str, text: &str| {
            let file = folder.join(name);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(&file, text).unwrap();
            std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o755)).unwrap();
        };
        write("archive/install", &install_script(&project).unwrap());
        write("archive/bin/pdk", "#!/bin/sh\necho pdk 0.1.0\n");
        write("stubs/uname", &format!("#!/bin/sh\ncase $1 in -s) echo Linux ;; *) echo {machine} ;; esac\n"));
        write("stubs/getconf", &format!("#!/bin/sh\n{libc}\n"));
        let path = format!("{}:/usr/bin:/bin", folder.join("stubs").display());
        let mut command = Command::new(folder.join("archive/install"));
        command.arg(folder.join("bin")).env("PATH", path).output().unwrap()
    }

    #[test]
    fn the_script_links_pdk_or_reports_why_it_does_not_run() {
        let folder = std::env::temp_dir().join(format!("pdk-install-{}", std::process::id()));
        for (machine, libc, expected) in [
            ("aarch64", "echo glibc 2.36", "this archive is for Linux on x86_64, and this is Linux aarch64"),
            ("x86_64", "exit 1", "this system has another C library, such as the musl of Alpine"),
            ("x86_64", "echo undefined", "this system has another C library"),
            ("x86_64", "echo glibc 2.17", "pdk needs glibc 2.28 or newer, and this system has 2.17"),
        ] {
            let ran = install(&folder, machine, libc);
            let said = String::from_utf8_lossy(&ran.stderr).into_owned();
            assert!(!ran.status.success() && said.contains(expected), "{said}");
            assert!(!folder.join("bin").exists());
        }
        for libc in ["echo glibc 2.28", "echo glibc 2.41", "echo glibc 3.0"] {
            let ran = install(&folder, "x86_64", libc);
            let said = String::from_utf8_lossy(&ran.stdout).into_owned();
            assert!(
                ran.status.success() && said.starts_with("pdk 0.1.0\n") && said.contains("not in the PATH"),
                "{ran:?}"
            );
        }
        std::fs::remove_dir_all(folder).unwrap();
    }
}
