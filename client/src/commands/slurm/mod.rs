//! `karst slurm`: films as arrays of frames, servers' workers as arrays of pilots.
//!
//! What runs on the nodes are the scripts in `slurm/`, which people may submit themselves; these commands submit
//! the same scripts, with what would be tedious to type, and ask Slurm, not a file of their own, what became of them.

mod frames;
mod missing;
mod pilots;
mod preflight;
mod queue;
mod ranges;
mod render;
mod shot;
mod tools;

use karst_client::Error;

use crate::args::SlurmCommand;
use crate::talk::Talk;

pub(super) fn run(command: SlurmCommand, talk: Talk) -> Result<(), Error> {
    match command {
        SlurmCommand::Frames(args) => frames::run(&args, talk),
        SlurmCommand::Missing(args) => missing::run(&args, talk),
        SlurmCommand::Preflight(args) => preflight::run(&args, talk),
        SlurmCommand::Render(args) => render::run(&args, talk),
        SlurmCommand::Up(args) => pilots::up(&args, talk),
        SlurmCommand::Status(args) => pilots::status(&args, talk),
        SlurmCommand::Down(args) => pilots::down(&args, talk),
    }
}
