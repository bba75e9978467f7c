//! Green-screen clips laid over the frame.
