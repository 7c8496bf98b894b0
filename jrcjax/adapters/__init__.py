"""The environment in the shapes that other libraries expect; each module needs the library that it is named after."""
