//! The plant with set-valued laws, against equations written out anew and a method of another kind.

mod agreement;
mod dual;
mod energy;
mod reference;
mod scenes;
