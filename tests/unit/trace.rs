mod averaged;
mod complete;
mod conclusion;
mod evidence;
mod facts;
mod holdout;
mod parts;
mod wedge;
