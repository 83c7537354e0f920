//! The device: a GPU, whose failures come back as errors.

use std::sync::{Arc, Mutex};

use crate::GpuError;

/// GPU to draw on: opened by us, or the caller's own. A clone costs nothing.
#[derive(Clone)]
pub struct Device {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    name: String,
    backend: wgpu::Backend,
    software: bool,
    /// Rewriting of each shader's text, before the driver sees it.
    rewrite: fn(&str) -> String,
    /// The first thing that went wrong outside of any call.
    failure: Arc<Mutex<Option<GpuError>>>,
}

/// Features that we use where the device has them.
const WANTED: wgpu::Features = wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::FLOAT32_FILTERABLE);

/// Groups in a row of a dispatch; shaders count invocations by it.
const GROUPS_IN_A_ROW: u32 = 1024;

impl Device {
    /// Opens the fastest GPU, or a software one where there is no other.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] and [`GpuError::NoDevice`].
    pub fn open() -> Result<Self, GpuError> {
        Self::open_with(WANTED)
    }

    /// Opens a GPU with those of these features that it has.
    pub(crate) fn open_with(wanted: wgpu::Features) -> Result<Self, GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..wgpu::RequestAdapterOptions::default()
        };
        let adapter =
            pollster::block_on(instance.request_adapter(&options)).map_err(|_| GpuError::NoAdapter)?;
        let info = adapter.get_info();
        let name = info.name.clone();
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("ndfmap"),
            required_features: adapter.features() & wanted,
            required_limits: adapter.limits(),
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|e| GpuError::NoDevice { adapter: name.clone(), reason: e.to_string() })?;
        let failure = Arc::new(Mutex::new(None));
        let (first, adapter) = (failure.clone(), name.clone());
        device.on_uncaptured_error(Arc::new(move |e| note(&first, error_of(&adapter, &e))));
        let (first, adapter) = (failure.clone(), name.clone());
        device.set_device_lost_callback(move |_, message| {
            note(&first, GpuError::Lost { adapter: adapter.clone(), reason: message });
        });
        Ok(Self { failure, ..Self::from_wgpu(device, queue) })
    }

    /// Wraps the caller's own device and queue. We do not listen for its errors; whoever opened it does.
    /// A device with [`wgpu::Features::FLOAT32_FILTERABLE`] takes maps of single floats.
    #[must_use]
    pub fn from_wgpu(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let info = device.adapter_info();
        let software = info.device_type == wgpu::DeviceType::Cpu;
        let (name, rewrite) = (info.name, str::to_owned);
        Self { device, queue, name, backend: info.backend, software, rewrite, failure: Arc::default() }
    }

    /// Device with every shader of ours rewritten: tests make it less exact than it is.
    #[doc(hidden)]
    #[must_use]
    pub fn rewriting_shaders(self, rewrite: fn(&str) -> String) -> Self {
        Self { rewrite, ..self }
    }

    /// Shader from its text.
    pub(crate) fn shader(&self, label: Option<&str>, text: &str) -> wgpu::ShaderModule {
        let source = wgpu::ShaderSource::Wgsl((self.rewrite)(text).into());
        self.device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source })
    }

    /// Device and queue of wgpu.
    #[must_use]
    pub fn wgpu(&self) -> (&wgpu::Device, &wgpu::Queue) {
        (&self.device, &self.queue)
    }

    /// Description: the adapter's name, its interface to us, and whether it is software.
    #[must_use]
    pub fn description(&self) -> String {
        let software = if self.software { ", software" } else { "" };
        format!("{} ({:?}{software})", self.name, self.backend)
    }

    /// True for a software GPU, which runs on the processor.
    #[must_use]
    pub fn is_software(&self) -> bool {
        self.software
    }

    /// True where the device itself measures the time of a pass.
    #[must_use]
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY)
    }

    /// Name of the adapter alone.
    pub(crate) fn name(&self) -> String {
        self.name.clone()
    }

    /// Waits for all work, and reports a failure since the last time, if any.
    ///
    /// # Errors
    /// [`GpuError`] that the driver raised.
    pub fn wait(&self) -> Result<(), GpuError> {
        // wgpu panics where the driver reports a loss during the wait.
        let wait = || self.device.poll(wgpu::PollType::wait_indefinitely());
        let waited = std::panic::catch_unwind(std::panic::AssertUnwindSafe(wait));
        let lost = |reason: String| GpuError::Lost { adapter: self.name(), reason };
        match waited {
            Err(_) => note(&self.failure, lost("waiting for it failed".to_owned())),
            Ok(Err(e)) => note(&self.failure, lost(e.to_string())),
            Ok(Ok(_)) => {}
        }
        let mut noted = self.failure.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        // A lost device stays lost.
        let failure =
            if matches!(*noted, Some(GpuError::Lost { .. })) { noted.clone() } else { noted.take() };
        failure.map_or(Ok(()), Err)
    }

    /// Checks that a texture of this size can be made.
    pub(crate) fn check_size(&self, what: &str, size: wgpu::Extent3d) -> Result<(), GpuError> {
        let limits = self.device.limits();
        let (most, most_layers) = (limits.max_texture_dimension_2d, limits.max_texture_array_layers);
        if size.width.max(size.height) <= most && size.depth_or_array_layers <= most_layers {
            return Ok(());
        }
        Err(GpuError::TooLarge {
            what: what.to_owned(),
            width: size.width,
            height: size.height,
            layers: size.depth_or_array_layers,
            adapter: self.name(),
            most,
            most_layers,
        })
    }

    /// Checks that a buffer of so many bytes can be made and read by a shader.
    pub(crate) fn check_bytes(&self, what: &'static str, bytes: u64) -> Result<(), GpuError> {
        let limits = self.device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        if bytes <= most {
            return Ok(());
        }
        let reason = format!("{what} take {bytes} bytes, and it reads at most {most}");
        Err(GpuError::Driver { adapter: self.name(), reason })
    }

    /// Runs the entry point `main` of a compute shader, of 64 invocations a group, once for each of `count`:
    /// binding 0 is read, 1 is written. Invocations count in rows of as many as a row of groups has. For
    /// tests of twins.
    ///
    /// # Errors
    /// [`GpuError`] that the driver raises, for an invalid shader too.
    #[doc(hidden)]
    pub fn compute(&self, shader: &str, input: &[u8], output: u64, count: u32) -> Result<Vec<u8>, GpuError> {
        self.check_bytes("the inputs", input.len() as u64)?;
        let input = self.upload(input, wgpu::BufferUsages::STORAGE);
        let output = self.storage("output", output)?;
        let pipeline = self.compute_pipeline(shader);
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: input.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: output.as_entire_binding() },
            ],
        });
        self.dispatch(&pipeline, &group, count);
        self.read(&output)
    }

    /// Buffer that shaders read. (The queue fills it: a buffer filled at creation panics on a lost device.)
    pub(crate) fn upload(&self, bytes: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes.len() as u64,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }

    /// Buffer that shaders write and we read.
    pub(crate) fn storage(&self, what: &'static str, size: u64) -> Result<wgpu::Buffer, GpuError> {
        self.check_bytes(what, size)?;
        Ok(self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        }))
    }

    /// Pipeline of a shader's entry point `main`, which may count invocations by ROW.
    pub(crate) fn compute_pipeline(&self, shader: &str) -> wgpu::ComputePipeline {
        let shader = format!("const ROW: u32 = {}u;\n{shader}", 64 * GROUPS_IN_A_ROW);
        let module = self.shader(None, &shader);
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
    }

    /// Encoder for new commands.
    pub(crate) fn encoder(&self) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Hands recorded commands to the GPU.
    pub(crate) fn submit(&self, encoder: wgpu::CommandEncoder) {
        self.queue.submit([encoder.finish()]);
    }

    /// Runs a pipeline once for each of `count`, in groups of 64.
    pub(crate) fn dispatch(&self, pipeline: &wgpu::ComputePipeline, group: &wgpu::BindGroup, count: u32) {
        let mut encoder = self.encoder();
        record_dispatch(&mut encoder, pipeline, group, count);
        self.submit(encoder);
    }

    /// Bytes of a buffer, once all work is done.
    pub(crate) fn read(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size: buffer.size(),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.encoder();
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
        self.submit(encoder);
        let mapped = Arc::new(Mutex::new(None));
        let result = mapped.clone();
        staging.map_async(wgpu::MapMode::Read, .., move |r| {
            *result.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(r);
        });
        self.wait()?;
        let driver = |reason: String| GpuError::Driver { adapter: self.name(), reason };
        match mapped.lock().unwrap_or_else(std::sync::PoisonError::into_inner).take() {
            Some(Ok(())) => {
                let view = staging.get_mapped_range(..).map_err(|e| driver(e.to_string()))?;
                Ok(view.to_vec())
            }
            Some(Err(e)) => Err(driver(e.to_string())),
            None => Err(driver("it never finished".to_owned())),
        }
    }
}

/// Records a run of a compute shader, once for each of `count`, in groups of 64.
pub(crate) fn record_dispatch(
    encoder: &mut wgpu::CommandEncoder,
    pipeline: &wgpu::ComputePipeline,
    group: &wgpu::BindGroup,
    count: u32,
) {
    if count == 0 {
        return;
    }
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group, &[]);
    // The standard allows few groups in a row: the rest goes to further rows.
    let groups = count.div_ceil(64);
    let columns = groups.min(GROUPS_IN_A_ROW);
    pass.dispatch_workgroups(columns, groups.div_ceil(columns), 1);
}

/// Keeps the first error; a lost device explains all others.
fn note(first: &Mutex<Option<GpuError>>, error: GpuError) {
    let mut first = first.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if first.is_none() || matches!(error, GpuError::Lost { .. }) {
        *first = Some(error);
    }
}

fn error_of(adapter: &str, error: &wgpu::Error) -> GpuError {
    match error {
        wgpu::Error::OutOfMemory { .. } => GpuError::OutOfMemory(adapter.to_owned()),
        other => GpuError::Driver { adapter: adapter.to_owned(), reason: other.to_string() },
    }
}
