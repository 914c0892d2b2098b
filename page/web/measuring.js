// Runs in a worker: measures the settled motion of the settings that it receives.
const model = new Promise((resolve) => {
  addEventListener("message", ({ data }) => {
    if (data.module) resolve(Model.from(data.module));
  });
});

addEventListener("message", async ({ data }) => {
  if (!("settings" in data)) return;
  const ready = await model;
  try {
    ready.configure(data.settings);
    const measured = ready.measure();
    postMessage({ settings: data.settings, measured }, [measured.states.buffer]);
  } catch (error) {
    postMessage({ settings: data.settings, error: error.message });
  }
});
