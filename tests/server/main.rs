//! Tests of the program as users see it: the binary, its serial line, its TCP port, its files.

mod accuracy;
mod any_language;
mod bringup;
mod by_hand;
mod commands;
mod controllers;
mod design;
mod drivers;
mod last_word;
mod log;
mod odrive;
mod output;
mod pages;
mod phenomena;
mod process;
mod protocols;
mod recover;
mod refusals;
mod replay;
mod safety;
mod scenes;
mod start;
mod stop;
mod terminal;
mod tls;
mod wall;
