mod void;
mod waves;
