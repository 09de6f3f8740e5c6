"""The playground: one page that simulates a grasp in the browser, with the C of the native FMUs."""
