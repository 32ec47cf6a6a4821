mod outlying;
mod pattern;
mod specimen;
mod sweep;
