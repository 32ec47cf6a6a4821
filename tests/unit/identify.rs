mod void;
