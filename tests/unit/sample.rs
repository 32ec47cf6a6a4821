mod memory;
mod stream;
