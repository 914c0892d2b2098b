// Runs in a worker: measures the settled motion of settings, and ends.
addEventListener("message", async ({ data: { module, settings } }) => {
  try {
    const model = await Model.from(module);
    model.configure(settings);
    const measured = model.measure();
    postMessage({ measured }, [measured.states.buffer]);
  } catch (error) {
    postMessage({ error: error.message });
  }
  close();
});
