//! Rig and scene files of an Hbot, with diagnostics that point at file, line and field.
